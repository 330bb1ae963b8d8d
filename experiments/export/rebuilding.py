"""Rebuild the table of a publication from its recordings."""

import csv
import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import cast

from acquisition.errors import SettingsError
from acquisition.files import read_regular
from acquisition.formats import format_problem
from analysis.report.findings import findings_rows
from analysis.report.results import compute_results
from analysis.report.sections.rig_health.health import with_tares
from analysis.study.fits import to_csv
from analysis.study.models import REPORTED, FitOptions
from experiments.export.publication import ANALYSIS, TABLE
from experiments.operator.console import Console
from experiments.report.choices import ReportRequest
from experiments.report.sessions import study_sessions
from experiments.session.data_files import read_json, reading
from experiments.session.store import list_sessions

TOLERANCE = 1e-9  # relative
_ABSOLUTE = 1e-12  # absolute, for values that are pure rounding
_LARGEST = 64_000_000  # bytes of a table
_KEY_COLUMNS = ("terrain", "model", "fold", "quantity", "unit")


@dataclass(frozen=True, slots=True)
class TableComparison:
    """Comparison of a rebuilt table with the published one.

    Attributes:
        rows: number of compared rows.
        worst: largest relative difference of two numbers.
        different: descriptions of the rows that differ by more than the tolerance.
    """

    rows: int
    worst: float
    different: Sequence[str]


def rebuild(folder: Path, console: Console) -> TableComparison:
    """Compute the table of results from the recordings alone, and compare.

    No stored results are used, and nothing is written into the folder.

    Raises:
        SettingsError: the folder has another version, or lacks the options of its
            results.
        TrialFileError: a file cannot be read.
        SessionError: there is no kept trial.
    """
    choices = read_json(folder / ANALYSIS)
    if choices and (problem := format_problem(choices.get("version"))):
        raise SettingsError(f"{folder / ANALYSIS} {problem}.")
    seed, terrains = choices.get("seed"), choices.get("terrains")
    if type(seed) is not int or seed < 0 or not isinstance(terrains, list):
        raise SettingsError(
            f"{folder / ANALYSIS} does not state how the results were made.",
            hint="Only a folder that traction publish wrote can be rebuilt.",
        )
    names = [str(name) for name in cast("list[object]", terrains)]
    request = ReportRequest(seed, names)
    fit = FitOptions(seed=seed, models=REPORTED)
    with tempfile.TemporaryDirectory(prefix="traction-rebuild-") as empty:
        sessions, data = list_sessions(folder), Path(empty)
        analysed = study_sessions(sessions, data, request, console, fit)
    trials = [trial for group in analysed.trials.values() for trial in group]
    rig = with_tares([t.health for t in trials], trials)
    results = compute_results(analysed.study, rig)
    again = to_csv(analysed.study, findings_rows(results))
    return compare_tables(_text(folder / TABLE), again)


def compare_tables(published: str, again: str) -> TableComparison:
    """Compare two tables in the form of fits.csv."""
    worst, count = 0.0, 0
    different: list[str] = []
    for ours, theirs in zip_longest(_rows(published), _rows(again)):
        count += 1
        if ours is None or theirs is None or ours[0] != theirs[0]:
            different.append(f"row {count} is {theirs}, published is {ours}")
            continue
        value, other = ours[1], theirs[1]
        if value == other or (math.isnan(value) and math.isnan(other)):
            continue
        scale = max(abs(value), abs(other))
        if not math.isclose(value, other, rel_tol=TOLERANCE, abs_tol=_ABSOLUTE):
            label = " ".join(filter(None, ours[0]))
            different.append(f"{label}: {other!r}, published is {value!r}")
        if scale > _ABSOLUTE / TOLERANCE:
            worst = max(worst, abs(value - other) / scale)
    return TableComparison(count, worst, different)


def _rows(text: str) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield (key, value) of every row."""
    for row in csv.DictReader(text.splitlines()):
        try:
            value = float(row["value"])
            yield tuple(row[name] for name in _KEY_COLUMNS), value
        except (KeyError, TypeError, ValueError) as error:
            raise SettingsError(
                f"{TABLE} is not a table of results ({error!r}).",
                hint="Was it edited? Name the changed files with: traction verify DIR",
            ) from error


def _text(path: Path) -> str:
    with reading(path):
        return read_regular(path, _LARGEST).decode(errors="replace")
