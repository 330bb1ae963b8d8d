"""Sessions on a full or broken disk, or without free file descriptors."""

import errno
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from experiments.operator.auto_operator import AutoOperator
from tests.crash.inspection import acknowledged, find_problems, recordings
from tests.crash.syscalls import recorded
from tests.experiments.program import Done, run_short, traction, write_config
from tests.experiments.run.test_resume import short

KINDS = (
    "full",
    "full-for-a-while",
    "broken",
    "broken-sync",
    "broken-read",
    "no-descriptors",
)
EXPECTED_CODES = {0, 2, 4, 5, 6}
AUTO = ("--operator-script", "auto")
BYTES = 400_000  # written by a session, approximately
CALLS = 500  # system calls of a session, approximately


@dataclass
class FailingDisk:
    """Make calls of one kind fail from a given one on; used as `limit` of `recorded`.

    Attributes:
        kind: one of `KINDS`.
        left: remaining bytes until the disk is full, or calls until it fails.
        lasts: number of failing calls.
        failed: number of calls that failed so far.
    """

    kind: str
    left: int
    lasts: int
    failed: int = 0

    def __call__(self, name: str, size: int) -> int:
        if self.kind.startswith("full"):
            return self._full(name, size)
        failing_calls = {
            "broken": {"write", "fsync", "replace", "create"},
            "broken-sync": {"fsync"},
            "broken-read": {"read", "list"},
            "no-descriptors": {"open", "create", "list"},
        }[self.kind]
        if name in failing_calls:
            self.left -= 1
            if self.left < 0 and self.failed < self.lasts:
                number = errno.EMFILE if self.kind == "no-descriptors" else errno.EIO
                self._fail(number)
        return size

    def _full(self, name: str, size: int) -> int:
        if self.left > size or name not in {"write", "create"}:
            self.left -= size
            return size
        allowed, self.left = self.left, 0
        if allowed > 0:
            return allowed
        if self.failed < self.lasts:
            self._fail(errno.ENOSPC)
        return size

    def _fail(self, number: int) -> None:
        self.failed += 1
        raise OSError(number, errno.errorcode[number])


def random_disk(rng: np.random.Generator, kinds: Sequence[str]) -> FailingDisk:
    """Return a disk that fails at a random moment of a session."""
    kind = kinds[rng.integers(len(kinds))]
    lasts = int(rng.integers(1, 6)) if kind != "full" else 1 << 30
    left = rng.integers(BYTES) if kind.startswith("full") else rng.integers(CALLS)
    return FailingDisk(kind, int(left), lasts)


def problems_with_failing_disks(
    folder: Path, runs: int, seed: int, kinds: Sequence[str] = KINDS
) -> list[str]:
    """Run sessions on failing disks and return the problems found.

    A session has two trials; then a verdict is changed and a kept trial repeated. The
    disk works again when its files are inspected.
    """
    config = write_config(folder)
    rng = np.random.default_rng(seed)
    problems = []
    for number in range(runs):
        disk = random_disk(rng, kinds)
        root = folder / f"disk{number}"
        root.mkdir()
        with recorded(root, disk) as recording:
            done = run_commands(config, root / "data")
        operations = recording.operations
        texts = [
            f"ended with {d.code}: {d.err}"
            for d in done
            if d.code not in EXPECTED_CODES
        ]
        if disk.failed and not any(d.err or "▲" in d.out for d in done):
            texts.append("the error was not reported")
        texts += find_problems(root, acknowledged(operations), recordings(operations))
        problems += [f"{number} {disk}: {text}" for text in texts]
        shutil.rmtree(root)
    return problems


def run_commands(config: Path, data: Path) -> list[Done]:
    """Run a session and change it; return the result of each command."""
    options = ("--data", data)
    done = [run_session(config, data)]
    if done[0].code == 0:
        done += [
            traction("verdict", "S001", "T01", "reject", "tilted", *options),
            traction("redo", "S001", "T02", "--reason", "wet", *AUTO, *options),
        ]
    return done


def run_session(config: Path, data: Path) -> Done:
    """Run two short trials; creating the session may fail as well."""
    original = AutoOperator.answer

    def answer(self, asked):
        key = short(asked)
        return original(self, asked) if key is None else key

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(AutoOperator, "answer", answer)
        return run_short(config, data, "TF", 2)
