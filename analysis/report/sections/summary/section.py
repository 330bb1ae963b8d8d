"""Section "Summary": samples and errors by terrain, and the Tustin parameters."""

from collections.abc import Iterator, Sequence

from analysis.data.quality import PULLED, PULLED_WARNING
from analysis.report.cell_texts import bounded_text, interval_text, with_error
from analysis.report.page_model import ReportContext, Section
from analysis.report.results import StudyResults
from analysis.report.section import ReportSection, ReportTable
from analysis.report.sections.summary.outliers import outlier_tables
from analysis.report.traction_ratio import traction_ratio
from analysis.study.models import TITLES, compared
from analysis.study.study import Study
from analysis.study.terrain_fit import PooledTustinFit, TerrainResult
from analysis.tustin.identifiability import Interval
from analysis.tustin.model import SYMBOLS, UNITS, TustinBounds

_DECADE = 10.0  # ratio of a profile's ends above which it is uninformative
WORTHWHILE = 0.9  # error relative to the constant below which a model is useful


def summary(study: Study) -> ReportTable:
    """Return the table of samples and errors, one row per terrain."""
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
        "standard deviation. MAE: mean absolute error on held-out trials, mean over "
        "trials ± its standard error. Constant: always the median F_t of the other "
        "trials. F_n ≤ 0: share of the kept samples with the foot off the ground, "
        "because it hops in a slip or the tare is wrong; a warning if F_n is "
        f"below −{PULLED:g} N in more than {PULLED_WARNING:.0%}.",
        section=ReportSection.SUMMARY,
    )


def parameters(study: Study) -> ReportTable:
    """Return the table of Tustin parameters of all trials with their intervals."""
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
    """State F_t/F_n of every terrain and whether a model is better than a constant.

    Terrains without errors of a model and of the constant are skipped.
    """
    models = compared(study.options.fit.models)
    return [
        f"{name}: F_t/F_n {traction_ratio(result)}; {verdict} ({numbers})."
        for name, result in study.terrains.items()
        for verdict, numbers in _verdict(result, models)
    ]


def _parameter_cell(whole: PooledTustinFit, key: str, bounds: TustinBounds) -> str:
    """Format a parameter with its interval, and its profile if that is open."""
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
    """Return whether a profile reaches a bound of the search or spans a decade."""
    is_at_edge = any(bounds.reached(key, end) for end in profile)
    return is_at_edge or profile.upper > _DECADE * profile.lower


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
    """Yield the verdict on the best model and its errors, if there are any."""
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


def _tables(results: StudyResults, _: ReportContext) -> list[ReportTable]:
    study = results.study
    return [*outlier_tables(study), summary(study), parameters(study)]


SECTION = Section(
    ReportSection.SUMMARY, _tables, sentences=lambda results: verdicts(results.study)
)
