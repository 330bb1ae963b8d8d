"""Does the test of covariates say the right words? Takes an hour on one core.

python -m studies.covariates FOLDER [--terrains S0,B15] [--seeds 5] [--trials 8]

FOLDER gets simulated sessions of the whole arm, made where they are missing, a data
folder for every terrain and seed. Height of the sole, way since the last drop and
lateral force are no knowledge of this ground; tilt and moment are moved by F_t. Every
line is what `traction report --covariate` says of one terrain and seed; the exit code
is 1 where a word is another one than it should be.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from analysis.data.load import load_trial
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.recorded_covariates import RECORDED, with_covariates
from analysis.findings.covariates import (
    WAY,
    CovariateResult,
    CovariateRows,
    covariate_results,
)
from analysis.study.models import FitOptions
from analysis.terrains.process_scores import PLATE_DROP, STONES_DROP
from traction import simulate

RIGHT = {
    "height": "no gain",
    WAY: "no gain",
    "lateral": "no gain",
    "tilt": "repeats F_t",
    "moment": "repeats F_t",
}


def results_of(
    folder: Path, terrain: str, seed: int, trials: int
) -> Sequence[CovariateResult]:
    """Return what the columns tell on one terrain by the trials of one seed."""
    data = folder / f"{terrain}-{seed}"
    if not data.is_dir():
        simulate(terrain, trials, seed, data)
    least = PLATE_DROP if terrain in {"TF", "Tf"} else STONES_DROP
    columns = (*(name for name in RIGHT if name in RECORDED), WAY)
    rows: list[CovariateRows] = []
    for path in sorted(data.glob("sessions/*/trials/T??.mcap"))[:trials]:
        series = with_covariates(load_trial(path), columns[:-1])
        prepared = prepare_trial(series, PrepareOptions())
        rows.append(CovariateRows.of(prepared, columns, least))
    return covariate_results({terrain: rows}, columns, FitOptions(), 1)


def main() -> int:
    """Print every sentence; 1 where a word is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--terrains", default="S0,B15")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--trials", type=int, default=8)
    args = parser.parse_args()
    right = count = 0
    for terrain in args.terrains.split(","):
        for seed in range(1, args.seeds + 1):
            for one in results_of(args.folder, terrain, seed, args.trials):
                is_right = one.verdict == RIGHT[one.column]
                right, count = right + is_right, count + 1
                mark = "" if is_right else "   WRONG"
                sys.stdout.write(f"seed {seed}: {one.sentence}{mark}\n")
                sys.stdout.flush()
    sys.stdout.write(f"{right} of {count} sentences are right\n")
    return int(right < count)


if __name__ == "__main__":
    sys.exit(main())
