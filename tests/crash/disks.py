"""Attack-table rows for disks: power cuts, I/O errors, full disks."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.attacks.attack import Attack, RunBy
from tests.crash.io_errors import KINDS, problems_with_failing_disks
from tests.crash.power_cuts import problems_after_power_cuts, record_session
from tests.crash.syscalls import Recording

_CUTS_PER_ROW = 120  # power cuts
_NIGHTLY_SEEDS = range(2, 10)
_NIGHTLY_RUNS = 60  # sessions per kind of failure


def disk_attacks() -> list[Attack]:
    """Return the rows for each power-cut seed and each kind of disk failure."""
    rows = [_power_cuts(1, RunBy.CI)]
    rows += [_power_cuts(seed, RunBy.NIGHTLY) for seed in _NIGHTLY_SEEDS]
    rows += [_failing(kind, 1, 1, RunBy.CI) for kind in KINDS]
    rows += [_failing(kind, 2, _NIGHTLY_RUNS, RunBy.NIGHTLY) for kind in KINDS]
    return rows


@cache
def recorded_session() -> Recording:
    """Record a session with every disk operation; cached."""
    with TemporaryDirectory(prefix="disks-") as folder:
        return record_session(Path(folder))


def _power_cuts(seed: int, run_by: RunBy) -> Attack:
    def check(folder: Path) -> None:
        problems = problems_after_power_cuts(
            recorded_session(), folder, _CUTS_PER_ROW, seed
        )
        assert not problems, "; ".join(problems)

    return Attack(
        "power cut",
        f"random moments of a session: {_CUTS_PER_ROW}, seed {seed}",
        "no kept trial lost; session recoverable",
        check,
        run_by,
        seconds=400,
    )


def _failing(kind: str, seed: int, count: int, run_by: RunBy) -> Attack:
    def check(folder: Path) -> None:
        problems = problems_with_failing_disks(folder, count, seed, (kind,))
        assert not problems, "; ".join(problems)

    return Attack(
        f"disk {kind}",
        f"sessions with a failure at a random moment: {count}, seed {seed}",
        "error reported with an exit code; no kept trial lost",
        check,
        run_by,
        seconds=120.0 * count,
    )
