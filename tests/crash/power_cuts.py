"""Power cuts at random disk operations of a recorded session."""

import shutil
from pathlib import Path

import numpy as np

from experiments.operator.prompts import Prompt
from tests.crash.disk import after_power_cut
from tests.crash.inspection import (
    acknowledged,
    find_problems,
    recordings,
    repair_sessions,
)
from tests.crash.syscalls import Recording, recorded
from tests.experiments.program import run_watched, traction, write_config
from tests.experiments.run.test_resume import short

AUTO = ("--operator-script", "auto")


def record_session(folder: Path) -> Recording:
    """Record the disk operations of a session with changed verdicts.

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


def problems_after_power_cuts(
    recording: Recording, folder: Path, cuts: int, seed: int
) -> list[str]:
    """Cut the power `cuts` times at random moments and return the problems found.

    On every third disk the power fails again during recovery.
    """
    rng = np.random.default_rng(seed)
    problems = []
    for number in range(cuts):
        length = int(rng.integers(len(recording.operations) + 1))
        operations = recording.operations[:length]
        wanted = acknowledged(operations)
        root = folder / f"cut{number}"
        after_power_cut(operations, rng).write(root)
        if number % 3 == 0:
            with recorded(root) as second:
                repair_sessions(root / "data")
            shutil.rmtree(root)
            until = int(rng.integers(second.start, len(second.operations) + 1))
            after_power_cut(second.operations[:until], rng).write(root)
        texts = find_problems(root, wanted, recordings(operations))
        problems += [f"{number} after {length} operations: {text}" for text in texts]
        shutil.rmtree(root)
    return problems
