"""Does `report` work with a thousand trials of one terrain? An hour on two cores.

python -m studies.many_trials FOLDER [--trials 1000] [--terrain S0] [--simulated 10]

FOLDER gets a data folder, made where it is missing. A few trials are simulated; every
other one is a copy of one of them that the project's writer records anew: with a level
of its own in the raw wrench, noise of the sensor, and a beginning that is cut.
`traction report --all` runs on all of them. Printed are its time and the largest memory
of all its processes together, shared pages counted once (PSS), as /proc has them every
half second; beyond `--limit` the exit code is 1.
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from acquisition.trial_file.reader import TrialReader
from benchmarks.made_sessions import make_sessions
from tests.disturbances.rewriting import rewrite

PER_SESSION = 10
LEVEL, NOISE = 0.1, 0.05  # share of the wrench; N and N m
CUT = 500  # cycles, at most
EVERY = 2.0  # s
GB = 1e9


class Copies:
    """Records trials that differ from a few simulated ones.

    Args:
        sources: files of these.
        seed: of what differs.
    """

    def __init__(self, sources: list[Path], seed: int) -> None:
        self._sources, self._rng = sources, np.random.default_rng(seed)
        self._cycles = [TrialReader(path).cycles().data for path in sources]
        self._count = 0

    def record(self, path: Path) -> None:
        """Write one more trial to `path`."""
        k = self._count % len(self._sources)
        self._count += 1
        cycles = self._cycles[k][self._rng.integers(CUT) :].copy()
        wrench = cycles["wrench_raw"]
        middle = wrench[:50].mean(axis=0)
        level = np.exp(self._rng.normal(0.0, LEVEL))
        noise = self._rng.normal(0.0, NOISE, wrench.shape)
        cycles["wrench_raw"] = middle + level * (wrench - middle) + noise
        session = path.parents[1].name.split("_")[1]
        stated = {"session": session, "trial": path.stem}
        rewrite(self._sources[k], path, cycles, stated=stated)


def traction(data: Path, *arguments: str) -> list[str]:
    """Return a command of the program."""
    return [sys.executable, "-m", "traction", *arguments, "--data", str(data)]


def make_data(folder: Path, terrain: str, trials: int, simulated: int) -> Path:
    """Return a data folder with so many trials of one terrain."""
    data, seeds = folder / "data", folder / "simulated"
    if not seeds.is_dir():
        options = ("--fake", "--fast", "--operator-script", "auto")
        run = traction(seeds, "run", terrain, *options, "--trials", str(simulated))
        subprocess.run(run, check=True, stdout=subprocess.DEVNULL)
    if not data.is_dir():
        made = sorted(seeds.glob("sessions/*/trials/T??.mcap"))
        count = -(-trials // PER_SESSION)
        record = Copies(made, seed=1).record
        make_sessions(data, count, trials=PER_SESSION, terrain=terrain, record=record)
    return data


def memory_of(process: int) -> float:
    """Return what a process and its descendants have in memory [bytes]."""
    total, waiting = 0.0, [process]
    while waiting:
        folder = Path("/proc") / str(waiting.pop())
        try:
            rollup = (folder / "smaps_rollup").read_text()
            total += 1024.0 * float(rollup.partition("\nPss:")[2].split()[0])
            for children in folder.glob("task/*/children"):
                waiting += map(int, children.read_text().split())
        except (OSError, IndexError):  # it has just ended
            continue
    return total


def main() -> int:
    """Make the trials, report them, print what it took; 1 beyond the limit."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--terrain", default="S0")
    parser.add_argument("--simulated", type=int, default=10)
    parser.add_argument("--limit", type=float, default=2.0, help="GB")
    args = parser.parse_args()
    data = make_data(args.folder, args.terrain, args.trials, args.simulated)
    started, most = time.monotonic(), 0.0
    with subprocess.Popen(traction(data, "report", "--all")) as report:
        while report.poll() is None:
            time.sleep(EVERY)
            most = max(most, memory_of(report.pid))
    minutes = (time.monotonic() - started) / 60.0
    sys.stdout.write(
        f"{args.trials} trials of {args.terrain}: exit code {report.returncode}, "
        f"{minutes:.1f} min, at most {most / GB:.2f} GB (limit {args.limit:g} GB)\n"
    )
    return int(report.returncode != 0 or most > args.limit * GB)


if __name__ == "__main__":
    sys.exit(main())
