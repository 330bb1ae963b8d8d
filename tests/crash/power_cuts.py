"""Power cuts anywhere in a session whose every change of the disk is recorded."""

import shutil
from pathlib import Path

import numpy as np

from experiments.operator.prompts import Prompt
from tests.crash.disk import after_power_cut
from tests.crash.inspection import (
    acknowledged,
    problems,
    put_in_order,
    recordings,
)
from tests.crash.syscalls import Recording, recorded
from tests.experiments.program import run_watched, traction, write_config
from tests.experiments.run.test_resume import short

AUTO = ("--operator-script", "auto")


def record_session(folder: Path) -> Recording:
    """Operations of a session with a rejected trial and changed verdicts.

    T01 is rejected, T01 and T02 are kept; later T01b is rejected and kept again and
    T02 is repeated.

    Args:
        folder: folder of the data and the configuration.
    """
    config = write_config(folder)
    data = folder / "recorded" / "data"
    data.parent.mkdir()

    def press(asked, _):
        is_bad = asked.prompt is Prompt.REVIEW and (asked.trial, asked.attempt) == (
            1,
            1,
        )
        return "r1" if is_bad else short(asked)

    with recorded(data.parent) as recording:
        assert run_watched(config, data, 2, press=press).done.code == 0
        options = ("--data", data)
        for command in (
            ("note", "S001", "T01", "wet", *options),
            ("verdict", "S001", "T01", "reject", "tilted", *options),
            ("verdict", "S001", "T01b", "keep", "was fine", *options),
            ("redo", "S001", "T02", "--reason", "wet", *AUTO, *options),
        ):
            done = traction(*command)
            assert done.code == 0, done.err
    return recording


def survive(recording: Recording, folder: Path, cuts: int, seed: int) -> list[str]:
    """Cut the power `cuts` times at random moments; the problems that follow.

    Every third disk is recovered while the power fails once more.
    """
    rng = np.random.default_rng(seed)
    wrong = []
    for number in range(cuts):
        length = int(rng.integers(len(recording.operations) + 1))
        operations = recording.operations[:length]
        wanted = acknowledged(operations)
        root = folder / f"cut{number}"
        after_power_cut(operations, rng).write(root)
        if number % 3 == 0:
            with recorded(root) as second:
                put_in_order(root / "data")
            shutil.rmtree(root)
            until = int(rng.integers(second.start, len(second.operations) + 1))
            after_power_cut(second.operations[:until], rng).write(root)
        texts = problems(root, wanted, recordings(operations))
        wrong += [f"{number} after {length} operations: {text}" for text in texts]
        shutil.rmtree(root)
    return wrong
