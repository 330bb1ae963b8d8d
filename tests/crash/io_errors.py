"""A disk that is full, broken, or a process without descriptors, in a session."""

import errno
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from experiments.operator.auto_operator import AutoOperator
from tests.crash.inspection import acknowledged, problems, recordings
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
ENDED = {0, 2, 4, 5, 6}
AUTO = ("--operator-script", "auto")
BYTES = 400_000  # that a session writes about
CALLS = 500  # that a session makes about


@dataclass
class FailingDisk:
    """Lets calls of one kind fail from a random moment on; a limit of `recorded`.

    Attributes:
        kind: one of `KINDS`.
        left: bytes until it is full, or calls until it breaks.
        lasts: how many calls fail.
        failed: how many have failed.
    """

    kind: str
    left: int
    lasts: int
    failed: int = 0

    def __call__(self, name: str, size: int) -> int:
        if self.kind.startswith("full"):
            return self._full(name, size)
        wanted = {
            "broken": {"write", "fsync", "replace", "create"},
            "broken-sync": {"fsync"},
            "broken-read": {"read", "list"},
            "no-descriptors": {"open", "create", "list"},
        }[self.kind]
        if name in wanted:
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
    """Return a disk that fails somewhere in a session."""
    kind = kinds[rng.integers(len(kinds))]
    lasts = int(rng.integers(1, 6)) if kind != "full" else 1 << 30
    left = rng.integers(BYTES) if kind.startswith("full") else rng.integers(CALLS)
    return FailingDisk(kind, int(left), lasts)


def fail(folder: Path, runs: int, seed: int, kinds: Sequence[str] = KINDS) -> list[str]:
    """Run sessions on failing disks; return what went wrong.

    A session has two trials; a kept one is repeated and a verdict changed then. The
    disk is sound again when its files are looked at.
    """
    config = write_config(folder)
    rng = np.random.default_rng(seed)
    wrong = []
    for number in range(runs):
        disk = random_disk(rng, kinds)
        root = folder / f"disk{number}"
        root.mkdir()
        with recorded(root, disk) as recording:
            done = use(config, root / "data")
        operations = recording.operations
        found = [f"ended with {d.code}: {d.err}" for d in done if d.code not in ENDED]
        if disk.failed and not any(d.err or "▲" in d.out for d in done):
            found.append("nothing was said")
        found += problems(root, acknowledged(operations), recordings(operations))
        wrong += [f"{number} {disk}: {text}" for text in found]
        shutil.rmtree(root)
    return wrong


def use(config: Path, data: Path) -> list[Done]:
    """Run a session and change it; return how each command ended."""
    options = ("--data", data)
    done = [run_session(config, data)]
    if done[0].code == 0:
        done += [
            traction("verdict", "S001", "T01", "reject", "tilted", *options),
            traction("redo", "S001", "T02", "--reason", "wet", *AUTO, *options),
        ]
    return done


def run_session(config: Path, data: Path) -> Done:
    """Run two short trials; the session may not even be made."""
    usual = AutoOperator.answer

    def answer(self, asked):
        key = short(asked)
        return usual(self, asked) if key is None else key

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(AutoOperator, "answer", answer)
        return run_short(config, data, "TF", 2)
