"""The loop with and without foresight beside it, in turn, on the wall clock.

make demo && python -m benchmarks.foresight [--windows 3] [--database FILE]

Each window is a simulated trial of its own. Printed are the percentiles of how far the
step from one cycle to the next is from 2 ms: goal, 99 % within 3 us of each other.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from acquisition.clock import PERIOD_NS
from acquisition.trial_file.reader import TrialReader
from experiments.session.store import list_sessions

_PERCENTILES = (50.0, 99.0, 99.9)
_SETTINGS = (
    ("late_per_second = 10", "late_per_second = 500"),
    ("test_time = 5.0", "test_time = 1.0"),
)


def window(folder: Path, database: Path | None) -> np.ndarray:
    """Return how far the steps of one trial are from 2 ms [us], shape (n,)."""
    program = [sys.executable, "-m", "experiments"]
    subprocess.run([*program, "init", str(folder)], check=True, capture_output=True)
    config = folder / "rig.toml"
    text = config.read_text()
    for old, new in _SETTINGS:
        text = text.replace(old, new)
    config.write_text(text)
    words = ["run", "S0", "--fake", "--processes", "--trials", "1"]
    words += ["--operator-script", "auto"]
    words += ["--config", str(config), "--data", str(folder / "data")]
    words += [] if database is None else ["--foresight", str(database)]
    subprocess.run([*program, *words], check=True, capture_output=True)
    (session,) = list_sessions(folder / "data")
    (path,) = session.kept_trials()
    reader = TrialReader(path)
    foreseen = len(reader.foresight().data) if database is not None else 1
    if not foreseen:
        sys.exit("Nothing was foreseen: another foot or rig than the database's?")
    times = reader.cycles().data["host_ns"].astype(np.int64)
    return np.abs(np.diff(times) - PERIOD_NS) * 1e-3


def main() -> int:
    """Run the windows in turn, print a line each and both together."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--windows", type=int, default=3)
    parser.add_argument(
        "--database", type=Path, default=Path("demo/study/terrains.json")
    )
    given = parser.parse_args()
    steps: dict[str, list[np.ndarray]] = {"without": [], "with": []}
    with tempfile.TemporaryDirectory() as scratch:
        for number in range(given.windows):
            for name, database in (("without", None), ("with", given.database)):
                folder = Path(scratch) / f"{name}{number}"
                late = window(folder, database.resolve() if database else None)
                steps[name].append(np.percentile(late, _PERCENTILES))
                print(f"{name:<8}", np.round(steps[name][-1], 1), "us")
    medians = {name: np.median(rows, axis=0) for name, rows in steps.items()}
    for name, row in medians.items():
        print(f"median {name:<8} p50, p99, p99.9 [us]:", np.round(row, 1))
    change = float(medians["with"][1] - medians["without"][1])
    print(f"p99 with less without: {change:+.1f} us (goal 3)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
