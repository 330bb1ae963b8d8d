"""Rows of failing disks: power cuts, failing writes and reads, full disks."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.attacks.attack import Attack, RunBy
from tests.crash.io_errors import KINDS, fail
from tests.crash.power_cuts import record_session, survive
from tests.crash.syscalls import Recording

_CUTS = 120  # of a row
_NIGHTS = range(2, 10)  # seeds
_DISKS = 60  # failing disks of a kind, in a night


def disk_attacks() -> list[Attack]:
    """Rows of power cuts, and of each kind of failing disk."""
    rows = [_power_cuts(1, RunBy.CI)]
    rows += [_power_cuts(seed, RunBy.NIGHTLY) for seed in _NIGHTS]
    rows += [_failing(kind, 1, 1, RunBy.CI) for kind in KINDS]
    rows += [_failing(kind, 2, _DISKS, RunBy.NIGHTLY) for kind in KINDS]
    return rows


@cache
def recorded_session() -> Recording:
    """A session whose every change of the disk is recorded, made once."""
    with TemporaryDirectory(prefix="disks-") as folder:
        return record_session(Path(folder))


def _power_cuts(seed: int, run_by: RunBy) -> Attack:
    def check(folder: Path) -> None:
        problems = survive(recorded_session(), folder, _CUTS, seed)
        assert not problems, "; ".join(problems)

    return Attack(
        "power cut",
        f"{_CUTS} moments of a session, seed {seed}",
        "no kept trial is lost; the session is put in order",
        check,
        run_by,
        seconds=400,
    )


def _failing(kind: str, seed: int, count: int, run_by: RunBy) -> Attack:
    def check(folder: Path) -> None:
        problems = fail(folder, count, seed, (kind,))
        assert not problems, "; ".join(problems)

    return Attack(
        f"disk {kind}",
        f"{count} moments of a session, seed {seed}",
        "said with an exit code; no kept trial is lost",
        check,
        run_by,
        seconds=120.0 * count,
    )
