"""Summary, verdicts and tables of the paper, as text without markup."""

from collections.abc import Iterator, Sequence

from analysis.data.quality import PULLED, PULLED_WARNING
from analysis.figures.sections import ReportSection
from analysis.findings.findings import StudyResults
from analysis.findings.paper_claims import PaperClaim
from analysis.findings.trends import traction_ratio
from analysis.report.page_model import ReportTable
from analysis.study.fits import flag_counts, tustin_medians
from analysis.study.metrics import standard_error
from analysis.study.models import TITLES, TUSTIN, compared
from analysis.study.study import Study
from analysis.study.terrain_fit import PooledTustinFit, TerrainResult, mean_of
from analysis.tustin.identifiability import Interval
from analysis.tustin.model import (
    MINIMUM_ROWS,
    NEGATIVE_B,
    NO_STRIBECK,
    NOT_IDENTIFIABLE,
    SYMBOLS,
    UNITS,
    TustinBounds,
    TustinParameters,
)

_DECADE = 10.0  # ratio of a profile's ends that says nothing about the value
WORTHWHILE = 0.9  # error over the constant's below which a model says something

# Table I of the paper, as printed
PAPER = {
    "S0": TustinParameters(mu=0.71, F_s=13.52, v_s=-0.841, delta_s=-0.017, b=-23.4),
    "B0": TustinParameters(mu=4.54, F_s=7.70, v_s=0.128, delta_s=0.011, b=-37.4),
    "TF": TustinParameters(mu=0.843, F_s=0.534, v_s=0.079, delta_s=420.0, b=7.49),
    "Tf": TustinParameters(mu=0.952, F_s=0.643, v_s=0.225, delta_s=2.60, b=0.023),
}


def summary(study: Study) -> ReportTable:
    """Return one line per terrain: how much was recorded, how well it is predicted."""
    models = compared(study.options.fit.models)
    return ReportTable(
        name="Samples and errors",
        header=(
            "terrain",
            "trials",
            "kept samples",
            "slips",
            "F_t/F_n",
            *(f"{TITLES[model]} MAE [N]" for model in models),
            "constant MAE [N]",
            "F_n ≤ 0",
        ),
        rows=[_summary_row(result, models) for result in study.terrains.values()],
        note="F_t/F_n: ratio of the means of a trial, mean of the trials ± their "
        "standard deviation. MAE: mean absolute error on trials that were left out of "
        "the fit, mean over trials ± its standard error. Constant: always the median "
        "F_t of the other trials. F_n ≤ 0: share of the kept samples with the foot off "
        "the ground, where it hops in a slip, or the tare wrong; a warning where it is "
        f"below −{PULLED:g} N in more than {PULLED_WARNING:.0%}.",
        section=ReportSection.SUMMARY,
    )


def parameters(study: Study) -> ReportTable:
    """Return the Tustin fit of all trials of each terrain with its intervals."""
    rows = []
    for name, result in study.terrains.items():
        whole = result.whole
        if whole.fit is None:
            rows.append([name, *["–"] * len(UNITS), "no fit"])
            continue
        cells = [_parameter_cell(whole, key, study.options.fit.bounds) for key in UNITS]
        rows.append([name, *cells, "; ".join(whole.fit.flags) or "none"])
    units = [f"{SYMBOLS[key]} [{unit}]" for key, unit in UNITS.items()]
    return ReportTable(
        name="Tustin parameters of all trials, with 95% intervals",
        header=("terrain", *units, "flags"),
        rows=rows,
        note="Bootstrap intervals over whole trials, because samples of one trial "
        "are correlated. Wide intervals: the curve is identified, the parameter "
        "is not. ≤ and ≥: the fit ended at a bound, the value may "
        "lie beyond. Open: the profile of the squared error (95%, counting "
        "independent samples) reaches a bound or spans more than a factor of ten.",
        section=ReportSection.SUMMARY,
    )


def verdicts(study: Study) -> list[str]:
    """Return for every terrain F_t/F_n, and whether a model says more than a constant.

    Without errors of a model and of the constant nothing is said.
    """
    models = compared(study.options.fit.models)
    return [
        f"{name}: F_t/F_n {traction_ratio(result)}; {verdict} ({numbers})."
        for name, result in study.terrains.items()
        for verdict, numbers in _verdict(result, models)
    ]


def table_one(study: Study) -> ReportTable:
    """Return Table I: median Tustin parameters, the paper's own row beside ours."""
    rows, bounds = [], study.options.fit.bounds
    for name, result in study.terrains.items():
        medians = tustin_medians(result)
        rows.append(
            [
                name,
                "this study",
                *(
                    "–" if (v := medians[key]) is None else bounded_text(bounds, key, v)
                    for key in UNITS
                ),
                "; ".join(flag_counts(result, TUSTIN)) or "none",
            ]
        )
        if name in PAPER and result.is_papers:
            printed = [f"{getattr(PAPER[name], key):g}" for key in UNITS]
            rows.append([name, "paper, Table I", *printed, ""])
    units = [f"{SYMBOLS[key]} [{unit}]" for key, unit in UNITS.items()]
    return ReportTable(
        name="Table I: Tustin parameters",
        header=("terrain", "source", *units, "flags"),
        rows=rows,
        note="Medians over the folds, parameter by parameter, so a row is not one "
        "coherent fit (≤, ≥: on a bound of the search); all predictions come from the "
        "coherent fits. " + _flag_legend(),
        section=ReportSection.PAPER,
    )


def statements(results: StudyResults) -> list[ReportTable]:
    """Return the paper's statements beside what the study shows.

    None for one terrain; for terrains that are not the paper's a line that says so.
    """
    terrains = results.study.terrains
    others = [name for name, result in terrains.items() if not result.is_papers]
    note = (
        "Errors: mean absolute errors on trials left out. Beyond chance: paired "
        "over the trials, p below 0.05 for all comparisons of the row together (Holm)."
    )
    if others:
        note = (
            "Not compared: the paper's statements are about its own eight terrains. "
            f"These are others: {_few_names(others)}."
        )
    if len(terrains) < 2:
        return []
    return [
        ReportTable(
            name="Findings of the paper",
            header=("in", "paper", "this study", "agrees?"),
            rows=[_statement_row(claim) for claim in results.claims],
            note=note,
            section=ReportSection.PAPER,
        )
    ]


_SHOWN = 6  # names in a sentence


def _few_names(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if names[_SHOWN:] else ""
    return ", ".join(names[:_SHOWN]) + more


def velocity_shares(study: Study) -> ReportTable:
    """Return how the samples of each terrain divide by velocity."""
    rows = []
    for name, result in study.terrains.items():
        shares = [trial.shares for trial in result.trials]
        means = [
            sum(getattr(share, key) for share in shares) / len(shares)
            for key in ("window", "sticking", "backward", "fast")
        ]
        moving = means[0] / (1.0 - means[1]) if means[1] < 1.0 else None
        rows.append([name, *(f"{mean:.1%}" for mean in means), _percent(moving)])
    return ReportTable(
        name="Distribution of the samples",
        header=("terrain", "window", "sticking", "backward", "too fast", "of moving"),
        rows=rows,
        note="Means over trials. Only the window is fitted and tested; the last column "
        "is its share of the samples that move.",
        section=ReportSection.BEYOND,
    )


def _parameter_cell(whole: PooledTustinFit, key: str, bounds: TustinBounds) -> str:
    """Return a parameter with its interval, and its profile where that is open."""
    if whole.fit is None:
        return "–"
    value, profiles = getattr(whole.fit.parameters, key), whole.fit.profiles
    cell = bounded_text(bounds, key, value)
    if key in whole.intervals:
        cell += f" ({interval_text(bounds, key, whole.intervals[key])})"
    profile = getattr(profiles, key, None)
    if isinstance(profile, Interval) and is_open(bounds, key, profile):
        cell += f"; open: {interval_text(bounds, key, profile)}"
    return cell


def is_open(bounds: TustinBounds, key: str, profile: Interval) -> bool:
    """Return whether a profile reaches an edge of the search or spans a decade."""
    is_at_edge = any(bounds.reached(key, end) for end in profile)
    return is_at_edge or profile.upper > _DECADE * profile.lower


def interval_text(bounds: TustinBounds, key: str, interval: Interval) -> str:
    """Return an interval as text, its ends on a bound as inequalities."""
    low, high = (bounded_text(bounds, key, end) for end in interval)
    return low if low == high else f"{low} to {high}"


def bounded_text(bounds: TustinBounds, key: str, value: float) -> str:
    """Return a parameter as text, one on a bound of the search as an inequality."""
    side = bounds.reached(key, value)
    mark = {"lower": "≤ ", "upper": "≥ "}[side] if side else ""
    return f"{mark}{value:.3g}"


def _statement_row(claim: PaperClaim) -> tuple[str, ...]:
    return claim.reference, claim.statement, claim.shown, claim.agreement.value


def _summary_row(result: TerrainResult, models: Sequence[str]) -> list[str]:
    return [
        result.terrain,
        str(len(result.trials)),
        str(result.kept),
        str(sum(map(len, result.slips))),
        traction_ratio(result),
        *(with_error(result.maes(model)) for model in models),
        with_error([result.constant_mae]),
        f"{result.lifted_share:.1%}",
    ]


def _verdict(result: TerrainResult, models: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield what the best model is worth, and the errors that say so, if any do."""
    errors = {m: mae for m in models if (mae := result.mae(m)) is not None}
    constant = result.constant_mae
    if not errors or not constant:
        return
    best = min(errors, key=errors.__getitem__)
    ratio = errors[best] / constant
    words = f"the best model's error is {ratio:.0%} of a constant's"
    if ratio > WORTHWHILE:
        much = "" if ratio >= 1.0 else " by much"
        words = f"no model beats a constant{much}"
    yield words, f"{TITLES[best]} {errors[best]:.2f} N, constant {constant:.2f} N"


def _flag_legend() -> str:
    return (
        "Flags: “at lower/upper bound” - the fit ended at a bound, so the "
        f"value is that bound; “{NEGATIVE_B}” - force falls with speed, which is not "
        "a viscosity; "
        f"“{NO_STRIBECK}” - a straight line in F_n and v_t does as well; "
        f"“{NOT_IDENTIFIABLE}” - the parameters are not identifiable separately. When "
        "flagged, compare curves, not parameters. v_s is given as its absolute value. "
        f"A fit needs {MINIMUM_ROWS} samples."
    )


def with_error(values: Sequence[float | None], form: str = ".3f") -> str:
    """Return the mean over trials ± its standard error as text."""
    mean, error = mean_of(values), standard_error(values)
    if mean is None:
        return "–"
    return f"{mean:{form}}" + ("" if error is None else f" ± {error:{form}}")


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1%}"
