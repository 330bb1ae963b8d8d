"""Tables of the report about the ground as a process: its events, and their samples."""

from collections.abc import Callable, Mapping
from math import exp

from analysis.figures.sections import ReportSection
from analysis.findings.findings import StudyResults
from analysis.findings.mobilisation import Mobilisation
from analysis.report.page_model import ReportTable
from analysis.terrains.contact_fit import constant_friction
from analysis.terrains.loadings import Interval90
from analysis.terrains.process_rows import process_trials

_COLUMNS = {  # of the table of events: unit and scale of every value
    "initial stiffness": ("N/m", 1.0, 0),
    "mobilisation way": ("mm", 1e3, 1),
    "run-out": ("mm", 1e3, 1),
    "drop": ("N", 1.0, 2),
    "Weibull shape of drops": ("", 1.0, 2),
    "way between drops": ("mm", 1e3, 1),
    "capacity over load": ("", 1.0, 2),
}


_NUMBERS: Mapping[str, tuple[str, Callable[[float], float], int]] = {
    "level": ("capacity [N]", exp, 1),
    "load": ("its exponent of F_n", float, 2),
    "spread": ("sd of its log", float, 2),
    "stiffness": ("stiffness [N/m]", exp, 0),
    "stiffness_spread": ("sd of its log", float, 2),
    "run": ("run-out, scale [mm]", lambda way: 1e3 * way, 1),
    "run_shape": ("its Weibull shape", float, 2),
    "mu": ("skin friction", float, 2),
    "viscosity": ("viscosity [N s/m]", float, 1),
    "partial_rate": ("partial drops [1/m]", float, 0),
    "partial_share": ("their share", float, 2),
    "creep": ("creep [mm/s]", lambda speed: 1e3 * speed, 1),
}  # of the table of contact laws: heading, what is shown, digits


def process_tables(results: StudyResults) -> list[ReportTable]:
    """Return the tables of events and of samples; one without rows is left out."""
    tables = [
        mobilisation_table(results),
        contact_table(results),
        sampled_table(results),
    ]
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


def contact_table(results: StudyResults) -> ReportTable:
    """Return the contact law of every terrain, beside constant friction."""
    rows = []
    for name, law in results.laws.items():
        friction = constant_friction(
            process_trials(results.study.terrains[name].trials)
        )
        rows.append(
            [
                name,
                f"{law.trials}, {law.releases}",
                *(
                    _ends(law.intervals[key], change, digits)
                    for key, (_, change, digits) in _NUMBERS.items()
                ),
                f"{friction:.2f}",
            ]
        )
    units = [unit for unit, _, _ in _NUMBERS.values()]
    return ReportTable(
        name="Contact law",
        header=("terrain", "trials, releases", *units, "constant friction"),
        rows=rows,
        note="A law with state for a foot that a simulator moves: stones jam, stretch, "
        "creep, give way in part and let go. In brackets the 90% interval for the "
        "value of as many other trials of the same ground. Constant friction: median "
        "of F_t/F_n of a foot that slides, all that a coefficient holds; with it a "
        "foot hardly ever slips. Plates have no law: nothing jams on them.",
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
    return _ends(interval, lambda x: scale * x, digits)


def _ends(interval: Interval90, change: Callable[[float], float], digits: int) -> str:
    value, low, high = (f"{change(x):.{digits}f}" for x in interval)
    return f"{value} ({low} to {high})"


def _exponential(found: Mobilisation) -> str:
    if found.has_exponential:
        return "identifiable"
    return f"not identifiable here ({found.straight:.0%} of loadings straight)"
