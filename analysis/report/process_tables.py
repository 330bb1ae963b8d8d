"""Tables of the report about the ground as a process: its events, and their samples."""

from analysis.figures.sections import ReportSection
from analysis.findings.findings import StudyResults
from analysis.findings.mobilisation import Mobilisation
from analysis.report.page_model import ReportTable
from analysis.terrains.loadings import Interval90

_COLUMNS = {  # of the table of events: unit and scale of every value
    "initial stiffness": ("N/m", 1.0, 0),
    "mobilisation way": ("mm", 1e3, 1),
    "run-out": ("mm", 1e3, 1),
    "drop": ("N", 1.0, 2),
    "Weibull shape of drops": ("", 1.0, 2),
    "way between drops": ("mm", 1e3, 1),
    "capacity over load": ("", 1.0, 2),
}


def process_tables(results: StudyResults) -> list[ReportTable]:
    """Return the tables of events and of samples; one without rows is left out."""
    tables = [mobilisation_table(results), sampled_table(results)]
    return [table for table in tables if table.rows]


def mobilisation_table(results: StudyResults) -> ReportTable:
    """Return how every terrain takes up a load and lets it go."""
    rows = [
        [
            name,
            *(_shown(key, found.values[key]) for key in _COLUMNS),
            _exponential(found),
        ]
        for name, found in results.mobilised.items()
    ]
    units = [f"{k} [{unit}]" if unit else k for k, (unit, _, _) in _COLUMNS.items()]
    return ReportTable(
        name="Mobilisation and events",
        header=("terrain", *units, "K of an exponential"),
        rows=rows,
        note="Initial stiffness: secant between 15 and 75% of a loading, median. "
        "Mobilisation way: peak over stiffness, median. Run-out: way from a peak to "
        "the next loading. Drops: falls of force, with the shape of their Weibull "
        "distribution. Capacity over load: F_t/F_n at the peaks, median. In brackets "
        "the 90% interval for the value of as many other trials of the same ground, "
        "from trials drawn again. K is identifiable where loadings bend.",
        section=ReportSection.BEYOND,
    )


def sampled_table(results: StudyResults) -> ReportTable:
    """Return how like trials left out samples of the generator are."""
    rows = [
        [
            name,
            "linear" if s.experts == 1 else f"{s.experts} experts",
            f"{s.fitted}, {s.left_out}",
            f"{s.energy:.2f}",
            f"{s.variogram:.2f}",
            f"{s.slips[0]:.1f}, {s.slips[1]:.1f}",
            f"{s.drops[0]:.1f}, {s.drops[1]:.1f}",
            f"{s.drop_distance:.2f}",
            f"{s.way_distance:.2f}",
        ]
        for name, s in results.sampled.items()
    ]
    return ReportTable(
        name="Sampled traction",
        header=(
            "terrain",
            "generator",
            "trials fitted to, left out",
            "energy score over rows",
            "variogram score over rows",
            "slips per metre, sampled and recorded",
            "drops per metre, sampled and recorded",
            "KS of drops",
            "KS of way between",
        ),
        rows=rows,
        note="A generator of two trials in three against the others. Scores are over "
        "those of independent rows of the same bands; below 1 is better. KS: largest "
        "distance between two distributions. A terrain whose generator fails the test "
        "of free runs with sticks of 20 s is not listed.",
        section=ReportSection.BEYOND,
    )


def _shown(key: str, interval: Interval90) -> str:
    _, scale, digits = _COLUMNS[key]
    value, low, high = (f"{scale * x:.{digits}f}" for x in interval)
    return f"{value} ({low} to {high})"


def _exponential(found: Mobilisation) -> str:
    if found.has_exponential:
        return "identifiable"
    return f"not identifiable here ({found.straight:.0%} of loadings straight)"
