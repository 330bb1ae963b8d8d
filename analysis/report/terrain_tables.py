"""Tables of what terrains give and of how they are told apart."""

from analysis.breakaway.model import SLIDING
from analysis.figures.sections import ReportSection
from analysis.findings.break_away import RISKS, TerrainBreakAway
from analysis.findings.findings import StudyResults
from analysis.report.page_model import ReportTable
from analysis.terrains.evidence import Exclusion
from analysis.terrains.identify import KEPT_PER_SECOND, Identification

_LEVELS = {  # in words; a factor has its own name
    "terrain": "each terrain",
    "stones": "size of stones",
    "surface": "flat or rocky",
}


def terrain_tables(results: StudyResults) -> list[ReportTable]:
    """Return the tables of forces from rest and of recognition."""
    return [break_away_table(results), *recognition_tables(results)]


def break_away_table(results: StudyResults) -> ReportTable:
    """Return the force available from rest and in motion, and what it rests on."""
    speeds = sorted({f.model.v_slip for f in results.break_away.values()})
    return ReportTable(
        name="Force available from rest and in motion",
        header=(
            "terrain",
            "from rest",
            "slipped",
            "held",
            "F_n [N]",
            *(f"F_t at risk {risk:g} [N]" for risk in RISKS),
            *(f"in motion at {risk:g} [N]" for risk in RISKS),
            "distance (limit)",
            "effect of the trial",
        ),
        rows=[_break_away_row(found) for found in results.break_away.values()],
        note="From rest: a push at a new place in a new trial slips with that "
        f"probability (v_slip {', '.join(f'{v:g}' for v in speeds)} m/s) before F_t "
        "reaches the force; brackets: 90 % interval by resampled trials. "
        '"sliding": too few pushes slipped, the force is that of slow motion. In '
        "motion: the force at the slowest velocity of the window is below it with that "
        "probability, by GP-SE. F_n: median of the pushes. Distance: of the model from "
        "the Kaplan-Meier curve, and its critical value at 5 %. The effect of the "
        "trial is the standard deviation of log force between trials, of force where "
        "sliding.",
        section=ReportSection.BEYOND,
    )


def _break_away_row(found: TerrainBreakAway) -> list[str]:
    model, load = found.model, found.load
    answers = [model.available(load, risk) for risk in RISKS]
    motion = [found.motion_quantile(risk) for risk in RISKS]
    limit = found.limit
    distance = "–" if limit is None else f"{model.distance:.2f} ({limit:.2f})"
    unit = " N" if model.kind == SLIDING else ""
    trial_sd = f"{model.law.trial_sd:.2f}{unit}"
    return [
        found.terrain,
        model.kind,
        str(model.slips),
        str(model.held),
        f"{load:.1f}",
        *(f"{a.force:.1f} ({a.low:.1f} to {a.high:.1f})" for a in answers),
        *("–" if force is None else f"{force:.1f}" for force in motion),
        distance,
        trial_sd if model.is_trial_seen else "not distinguishable from 0",
    ]


def recognition_tables(results: StudyResults) -> list[ReportTable]:
    """Return how well windows of motion tell the terrains apart; none for one."""
    identification = results.identification
    if identification is None:
        return []
    rules = (identification.by_density, identification.by_error)
    rows = [
        (
            f"{size / KEPT_PER_SECOND:g} s",
            *(
                f"{rule[size][level].accuracy:.2f}"
                for rule in rules
                for level in identification.levels
            ),
        )
        for size in identification.sizes
    ]
    names = [_LEVELS.get(level, level) for level in identification.levels]
    return [
        ReportTable(
            "Terrain classification",
            (
                "window",
                *(f"by density: {name}" for name in names),
                *(f"by error: {name}" for name in names),
            ),
            rows,
            note="Share of windows recognised by models that never saw the trial, mean "
            "over kinds. By error, the paper's rule: the model with the smallest mean "
            f"absolute error. {_stones_note(identification)}",
            section=ReportSection.BEYOND,
        ),
        surface_table(identification),
    ]


def surface_table(identification: Identification) -> ReportTable:
    """Return how well flat and rocky ground and ground that is not known are told."""
    rows = [
        (
            f"{size / KEPT_PER_SECOND:g} s",
            *_surface_cells(identification, size),
            *_exclusion_cells(identification.exclusions[size]),
        )
        for size in identification.sizes
    ]
    return ReportTable(
        name="Flat, rocky or unknown ground",
        header=(
            "window",
            "flat or rocky, accuracy",
            "calibration error",
            "98 % confident",
            "confident and wrong",
            "known, called none",
            "flat, only rocky known: none",
            "rocky, only flat known: none",
        ),
        rows=rows,
        note="Flat or rocky: logistic regression on features of the window, fitted to "
        "trials of other numbers; right: mean over the two; calibration error: mean "
        "difference of probability and share. None: a window that strains the "
        "likeliest terrain's model more than 99 % of its own windows, or is smoother "
        "than 98.75 % of them; limits from trials of other numbers.",
        section=ReportSection.BEYOND,
    )


def _surface_cells(identification: Identification, size: int) -> list[str]:
    if size not in identification.by_features:
        return ["–"] * 4
    calibration = identification.calibrations[size]
    return [
        f"{identification.by_features[size]['surface'].accuracy:.3f}",
        f"{calibration.error:.3f}",
        f"{calibration.sure:.2f}",
        f"{calibration.sure_and_wrong:.3f}",
    ]


def _exclusion_cells(exclusion: Exclusion) -> list[str]:
    shares = (
        exclusion.false_alarms,
        exclusion.flat_among_rocky,
        exclusion.rocky_among_flat,
    )
    return ["–" if share is None else f"{share:.3f}" for share in shares]


def _stones_note(identification: Identification) -> str:
    """Return that terrains of stones are one family; empty with fewer than two."""
    shares = {
        size: share
        for size in identification.sizes
        if (share := identification.exact_stones(size)) is not None
    }
    if not shares:
        return ""
    size = max(shares)
    return (
        "Terrains of stones are a family: the single terrain is correct in "
        f"{shares[size]:.2f} of their windows of {size / KEPT_PER_SECOND:g} s "
        f"({1.0 / identification.stones:.2f} by chance), so only the class flat or "
        "rocky is identifiable, not the single terrain."
    )
