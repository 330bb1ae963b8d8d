"""Tables of the report beyond the paper's: uncertainty, comparisons, trends."""

from collections.abc import Sequence
from math import isinf
from statistics import median

from analysis.data.plausibility import LATEST_MS
from analysis.figures.sections import ReportSection
from analysis.findings.findings import StudyResults
from analysis.findings.look_first import PUSH_LIMIT, SENSOR_LIMIT, look_first
from analysis.findings.trends import MEAN_FORCE, MEAN_LOAD, TRACTION_RATIO, Trend
from analysis.report.new_trial_tables import new_trial_tables
from analysis.report.page_model import ReportTable
from analysis.report.paper_tables import with_error
from analysis.report.terrain_tables import terrain_tables
from analysis.study.metrics import (
    PairedComparison,
    adjusted_by_holm,
    compare,
    smallest_adjusted,
)
from analysis.study.models import TITLES
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_MOST_ODD = 10  # trials to look at first
_SHOWN = ("rmse", "nlpd", "crps", "coverage50", "coverage90", "coverage95", "variance")
_HEADS = (
    "RMSE [N]",
    "NLPD [nat]",
    "CRPS [N]",
    "inside 50% band",
    "90%",
    "95%",
    "variance [N²]",
)


def beyond_tables(results: StudyResults) -> list[ReportTable]:
    """Return the tables beyond the paper's; one without rows is left out."""
    study = results.study
    tables = [
        uncertainty(study),
        independent_samples(results),
        *(paired_table(study, key, unit) for key, unit in _MEASURES),
        noise_table(results),
        *new_trial_tables(results),
        lag_table(study),
        *terrain_tables(results),
        trend_table(results),
    ]
    return [table for table in tables if table.rows]


def look_first_tables(study: Study) -> list[ReportTable]:
    """Return the trials that stand out, the farthest first; none where none does."""
    odd = look_first(study)
    if not odd:
        return []
    table = ReportTable(
        name="Look at these first",
        header=("terrain", "trial", "name", "times the limit", "why"),
        rows=[
            [
                trial.terrain,
                str(trial.number),
                trial.name,
                "cannot be right" if isinf(trial.score) else f"{trial.score:.1f}",
                "; ".join(trial.reasons),
            ]
            for trial in odd[:_MOST_ODD]
        ],
        note="Distance from the median of the terrain's other trials, as rare as a "
        "normal value so many standard deviations out. Its limit is "
        f"{SENSOR_LIMIT:g} in what only the sensor changes, {PUSH_LIMIT:g} in what "
        "stones and hand change, too; a trial whose motion and forces contradict each "
        "other is named in any case. One that stands out is not wrong by that: look at "
        "its curve, then decide."
        + (f" {len(odd) - _MOST_ODD} more." if odd[_MOST_ODD:] else ""),
        section=ReportSection.SUMMARY,
    )
    return [table]


def lag_table(study: Study) -> ReportTable:
    """Return how much later than the motion the forces were."""
    rows: list[list[str]] = []
    for name, result in study.terrains.items():
        lags = [t.lag.seconds * 1e3 for t in result.trials if t.lag is not None]
        if not result.trials:
            continue
        stamps = median(t.stamped_lag * 1e3 for t in result.trials)
        shown = f"{len(lags)} of {len(result.trials)}"
        if not lags:
            rows.append([name, shown, "–", "–", f"{stamps:.1f}"])
            continue
        ends = f"{min(lags):.1f} to {max(lags):.1f}"
        rows.append([name, shown, f"{median(lags):.1f}", ends, f"{stamps:.1f}"])
    return ReportTable(
        name="Delay of force relative to motion",
        header=(
            "terrain",
            "trials that show it",
            "lag [ms]",
            "range",
            "by time stamps",
        ),
        rows=rows,
        note="The offset at which -F_t = M dv/dt + B v explains most of F_t between 10 "
        "and 80 Hz (3 and 40 Hz where velocity is coarse), M and B free. Above zero "
        "the force is late. A trial shows it where half of the variance is explained: "
        "stones that jam and let go do, a smooth plate does not. The last column is "
        "the median age of the forces by the time stamps of the recording; more than "
        f"{LATEST_MS:g} ms from it is a warning.",
        section=ReportSection.BEYOND,
    )


def uncertainty(study: Study) -> ReportTable:
    """Return how honest the predicted uncertainties were."""
    rows = [
        [name, TITLES[model], *_cells(result, model)]
        for name, result in study.terrains.items()
        for model in study.options.fit.models
        if result.models(model)
    ]
    return ReportTable(
        name="Predicted uncertainty",
        header=("terrain", "model", *_HEADS),
        rows=rows,
        note="Means over the held-out trials ± standard error over trials, not over "
        "samples. NLPD: negative log density; CRPS: continuous ranked probability "
        "score; both reward a calibrated spread, less is better. A band whose "
        "coverage is far below its nominal share is too narrow. The variance is that "
        "of a measurement, noise included.",
        section=ReportSection.BEYOND,
    )


def independent_samples(results: StudyResults) -> ReportTable:
    """Return how many independent samples the held-out residuals are worth."""
    rows = [
        (
            name,
            TITLES[model],
            str(band.samples),
            f"{band.correlation:.3f}",
            f"{band.time:.0f}",
            f"{band.independent:.0f}",
        )
        for name, bands in results.residuals.items()
        for model, band in bands.items()
    ]
    return ReportTable(
        name="Independent samples",
        header=(
            "terrain",
            "model",
            "kept samples",
            "lag-1 autocorrelation",
            "autocorrelation time [samples]",
            "independent samples",
        ),
        rows=rows,
        note="Residuals, measured minus predicted force, of held-out trials. "
        "Independent: kept samples over the integrated autocorrelation time, summed "
        "until the correlation falls below 0.05. Standard errors in this report "
        "therefore count trials, never samples.",
        section=ReportSection.BEYOND,
    )


def paired_table(study: Study, key: str, unit: str) -> ReportTable:
    """Return every model against the first one, trial by trial."""
    first, *others = study.options.fit.models
    names = [n for n, r in study.terrains.items() if others and r.models(first)]
    pairs = [
        compare(study.terrains[n].scores(first, key), study.terrains[n].scores(m, key))
        for n in names
        for m in others
    ]
    cells, width = paired_cells(pairs), len(others)
    rows = [[n, *cells[k * width : (k + 1) * width]] for k, n in enumerate(names)]
    return ReportTable(
        name=f"{key.upper()} difference to {TITLES[first]}, paired by trial",
        header=("terrain", *(f"{TITLES[model]} [{unit}]" for model in others)),
        rows=rows,
        note=f"Difference to {TITLES[first]} ± its standard error over the trials; "
        "below zero is better. p: exact permutation test over the signs "
        f"of the differences. {_holm_note(pairs)}",
        section=ReportSection.BEYOND,
    )


def paired_cells(pairs: Sequence[PairedComparison | None]) -> list[str]:
    """Return the comparisons of one table as text, p of each and for all together."""
    adjusted = iter(adjusted_by_holm([pair.p for pair in pairs if pair is not None]))
    return [
        paired_cell(pair, None if pair is None else next(adjusted)) for pair in pairs
    ]


def paired_cell(paired: PairedComparison | None, adjusted: float | None = None) -> str:
    """Return a comparison as text, with p for all comparisons together if given."""
    if paired is None:
        return "–"
    error = "" if paired.standard_error is None else f" ± {paired.standard_error:.3f}"
    together = "" if adjusted is None else f", Holm {adjusted:.2g}"
    return f"{paired.difference:+z.3f}{error} (p {paired.p:.2g}{together})"


def _holm_note(pairs: Sequence[PairedComparison | None]) -> str:
    present = [pair for pair in pairs if pair is not None]
    return (
        f"Holm: p adjusted for the {len(present)} comparisons of this table; only "
        "below 0.05 is a difference more than chance. So many comparisons over so few "
        f"trials cannot go below {smallest_adjusted(present):.2g}."
    )


def noise_table(results: StudyResults) -> ReportTable:
    """Return which noise was chosen per terrain, and NLPD before and after."""
    rows = [
        [
            s.terrain,
            ", ".join(f"{name} in {n}" for name, n in s.counts.items() if n),
            f"{s.before:.3f}",
            f"{s.after:.3f}",
            cell,
        ]
        for s, cell in zip(
            results.noise, paired_cells([s.paired for s in results.noise]), strict=True
        )
    ]
    pairs = [s.paired for s in results.noise]
    return ReportTable(
        name="Noise chosen",
        header=("terrain", "folds", "NLPD constant", "NLPD chosen", "difference"),
        rows=rows,
        note=_holm_note(pairs),
        section=ReportSection.BEYOND,
    )


def trend_table(results: StudyResults) -> ReportTable:
    """Return repeatability and first-to-last trend of every terrain."""
    rows = []
    for name, trends in results.trends.items():
        force, load, ratio = (
            trends[key] for key in (MEAN_FORCE, MEAN_LOAD, TRACTION_RATIO)
        )
        if force.means.size < 2:
            continue
        rows.append(
            [
                name,
                str(force.means.size),
                f"{force.means.mean():.2f} ± {force.spread:.2f}",
                slope_cell(force),
                f"{ratio.means.mean():.2f} ± {ratio.spread:.2f}",
                slope_cell(ratio),
                f"{load.means.mean():.2f} ± {load.spread:.2f}",
            ]
        )
    return ReportTable(
        name="Repeatability and trend over trials",
        header=(
            "terrain",
            "trials",
            "F_t [N]",
            "F_t per trial [N]",
            "F_t/F_n",
            "F_t/F_n per trial",
            "F_n [N]",
        ),
        rows=rows,
        note="Means of the trials ± their standard deviation; slopes ± standard error. "
        "A slope of more than two standard errors points to wear of the terrain.",
        section=ReportSection.BEYOND,
    )


def slope_cell(trend: Trend) -> str:
    """Return a slope with its standard error as text, – where there is none."""
    if trend.slope is None or trend.slope_error is None:
        return "–"
    return f"{trend.slope:+z.3f} ± {trend.slope_error:.3f}"


_MEASURES = (("mae", "N"), ("nlpd", "nat"))


def _cells(result: TerrainResult, model: str) -> list[str]:
    return [
        with_error(
            result.scores(model, key), ".1%" if key.startswith("coverage") else ".3f"
        )
        for key in _SHOWN
    ]
