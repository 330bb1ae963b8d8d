"""Tables of what terrains give and of how they are told apart."""

from analysis.breakaway import SLIDING
from analysis.data import LEVELS
from analysis.figures import ReportSection
from analysis.findings import RISKS, StudyResults, TerrainBreakAway
from analysis.report.page_model import ReportTable
from analysis.terrains import KEPT_PER_SECOND


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
        "Kaplan and Meier's curve, and what chance exceeds in 5 %. The effect of the "
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
        trial_sd if model.is_trial_seen else "not told apart from 0",
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
                for level in LEVELS
            ),
        )
        for size in identification.sizes
    ]
    names = ("each terrain", "size of stones", "flat or rocky")
    return [
        ReportTable(
            "Telling terrains apart",
            (
                "window",
                *(f"by density: {name}" for name in names),
                *(f"by error: {name}" for name in names),
            ),
            rows,
            note="Share of windows recognised by models that never saw the trial, mean "
            "over kinds. By error, the paper's rule: the model with the smallest mean "
            "absolute error.",
            section=ReportSection.BEYOND,
        )
    ]
