"""How well terrains are told apart, held out: `python -m studies.terrain_scores FILE`.

Flat or rocky by the classifier of trials of other numbers, and windows of ground that
is not known, against the figures they have to meet.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from analysis.data.tables import load_tables
from analysis.study.models import GP_SE, FitOptions
from analysis.study.study import StudyOptions, run_study
from analysis.terrains.identify import KEPT_PER_SECOND, Identification, identify_study

LEAST_RIGHT = {50: 0.96, 100: 0.98, 200: 0.99}
MOST_ERROR, MOST_FALSE = 0.05, 0.06
LEAST_EXCLUDED = {100: (0.70, 0.90), 200: (0.90, 0.90)}  # flat, rocky


def identified(path: Path, points: int = 300) -> Identification:
    fit = FitOptions(models=(GP_SE,), gp_points=points, draws=0)
    study = run_study(load_tables([path]), StudyOptions(fit=fit), simulated=True)
    found = identify_study(study)
    if found is None:
        sys.exit(f"{path}: fewer than two terrains")
    return found


def verdicts(found: Identification) -> list[tuple[str, bool]]:
    """Return every figure as text, and whether it is met."""
    rows = []
    for size in found.sizes:
        seconds = f"{size / KEPT_PER_SECOND:g} s"
        right = found.by_features[size]["surface"].accuracy
        error, out = found.calibrations[size].error, found.exclusions[size]
        rows += [
            _least(f"{seconds}: flat or rocky", right, LEAST_RIGHT[size]),
            _most(f"{seconds}: calibration error", error, MOST_ERROR),
            _most(
                f"{seconds}: known, called none", out.false_alarms or 0.0, MOST_FALSE
            ),
        ]
        if size in LEAST_EXCLUDED:
            flat, rocky = LEAST_EXCLUDED[size]
            rows += [
                _least(f"{seconds}: flat, none", out.flat_among_rocky or 0.0, flat),
                _least(f"{seconds}: rocky, none", out.rocky_among_flat or 0.0, rocky),
            ]
    return rows


def _least(text: str, value: float, limit: float) -> tuple[str, bool]:
    return f"{text} {value:.3f} >= {limit:g}", value >= limit


def _most(text: str, value: float, limit: float) -> tuple[str, bool]:
    return f"{text} {value:.3f} <= {limit:g}", value <= limit


def main(words: Sequence[str] | None = None) -> int:
    """Print the figures; return 1 where one is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, help="npz tables of trials")
    args = parser.parse_args(words)
    is_met = True
    for path in args.files:
        found = identified(path)
        print(path.name)
        for text, holds in verdicts(found):
            print(f"{'met' if holds else 'MISSED'}: {text}")
            is_met = is_met and holds
        for size in found.sizes:
            print(
                f"{size / KEPT_PER_SECOND:g} s: the own one of {found.stones} terrains "
                f"of stones likeliest in {found.exact_stones(size) or 0.0:.2f}"
            )
    return int(not is_met)


if __name__ == "__main__":
    sys.exit(main())
