"""Predictive distribution of a new trial, and variance components of the trials."""

import numpy as np

from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.sections.beyond_paper.new_trial_bands import oracle_table
from analysis.report.style import Figure
from analysis.report.velocity_panels import (
    draw_panels,
    draw_quantiles,
    one_per_kind,
    panels,
)
from analysis.study.distribution import SHARES
from analysis.study.metrics import compare
from analysis.study.models import GP_SE_NOISE, GP_SE_TRIAL
from analysis.study.new_trial import NewTrialModel
from analysis.study.study import Study
from analysis.study.terrain_fit import mean_of
from analysis.study.trial_components import TrialComponents

_LEAST = 0.01  # noise relative to the residual within a trial, indistinguishable from 0


def new_trial_tables(results: StudyResults) -> list[ReportTable]:
    """Return the non-empty tables on predictions of a new trial."""
    tables = [
        residual_table(results.study),
        components_table(results.study),
        oracle_table(results),
    ]
    return [table for table in tables if table.rows]


def residual_table(study: Study) -> ReportTable:
    """Return the table of the residual distribution of a new trial."""
    rows: list[list[str]] = []
    for name, result in study.terrains.items():
        fitted = [fold.model for fold in result.models(GP_SE_TRIAL)]
        models = [model for model in fitted if isinstance(model, NewTrialModel)]
        if not models:
            continue
        ends = [SHARES.index(share) for share in (0.05, 0.95)]
        low, high = np.mean([[m.residuals[k] for k in ends] for m in models], axis=0)
        before, after = (result.scores(m, "nlpd") for m in (GP_SE_NOISE, GP_SE_TRIAL))
        paired, mean = compare(before, after), mean_of(after)
        rows.append(
            [
                name,
                f"{np.mean([model.level_sd for model in models]):.2f}",
                f"{low:+.2f} to {high:+.2f}",
                "–" if mean is None else f"{mean:.3f}",
                "–" if paired is None else f"{-paired.difference:+z.3f}",
            ]
        )
    return ReportTable(
        name="Predictive distribution of a new trial",
        header=(
            "terrain",
            "spread of levels [N]",
            "5 to 95 % of residuals [sd]",
            "NLPD [nat]",
            "gain over chosen noise [nat]",
        ),
        rows=rows,
        note="A Gaussian process whose noise depends on load and velocity, a level "
        "of every trial, and the quantiles of residuals of training trials, each left "
        "out in turn; those of a normal distribution are -1.64 to +1.64. Means over "
        "folds. Scores are of held-out trials.",
        section=ReportSection.BEYOND,
    )


def components_table(study: Study) -> ReportTable:
    """Return the table of variance components and the error of a terrain's level."""
    rows = [
        [
            name,
            _between(components),
            _with_interval(components, "within", "N"),
            _with_interval(components, "tau", "s"),
            _measurement(components),
            f"{components.independent:.0f}",
            f"{components.level_sd(1):.2f}",
            f"{components.level_sd(components.trials):.2f} ({components.trials})",
            f"{components.level_sd(components.trials + 1):.2f}",
        ]
        for name, result in study.terrains.items()
        if (components := result.components) is not None
    ]
    return ReportTable(
        name="Variance components",
        header=(
            "terrain",
            "between trials",
            "within a trial",
            "correlation time",
            "measurement",
            "independent values per trial",
            "level after one trial [N]",
            "after all trials [N]",
            "after one more [N]",
        ),
        rows=rows,
        note="Standard deviations with 95% bootstrap intervals over trials. Between: "
        "level of each trial. Within: correlated residual along a trial, with its "
        "correlation time. Measurement: uncorrelated between rows. Last columns: "
        "standard error of the terrain's level. A spread between trials that gains "
        "less than 1.4 in log likelihood is not distinguishable from 0. The spread "
        "between trials is estimated by moments for 30 trials or more, otherwise by "
        "the restricted likelihood; the other estimate is given if the two differ by "
        "more than twice the standard error.",
        section=ReportSection.BEYOND,
    )


def _between(components: TrialComponents) -> str:
    if not components.is_distinguishable:
        return f"not distinguishable from 0 (gain {components.gain:.1f})"
    shown = f"{_with_interval(components, 'between', 'N')} (gain {components.gain:.1f})"
    if components.do_differ and components.other is not None:
        return f"{shown}; the other estimate is {components.other:.2f} N"
    return shown


def _measurement(components: TrialComponents) -> str:
    if components.measurement < _LEAST * components.within:  # at the search bound
        return "not distinguishable from 0"
    return _with_interval(components, "measurement", "N")


def _with_interval(components: TrialComponents, name: str, unit: str) -> str:
    value, interval = getattr(components, name), components.intervals.get(name)
    if interval is None:
        return f"{value:.2f} {unit}"
    return f"{value:.2f} ({interval.lower:.2f} to {interval.upper:.2f}) {unit}"


def draw_new_trial(results: StudyResults) -> Figure | None:
    """Draw the 90 % band of a new trial, with the samples."""
    return draw_panels(panels(results.study, GP_SE_TRIAL), draw_quantiles)


def caption_new_trial(results: StudyResults) -> str:
    """State the extent of the bands of a new trial about the median."""
    reach = [
        f"{low:.2f} N below and {high:.2f} N above on {panel.terrain}"
        for panel in one_per_kind(panels(results.study, GP_SE_TRIAL))
        for low, high in [np.median(np.diff(panel.band, axis=0), axis=1)]
    ]
    return (
        "First fold of each terrain: median and the 5 to 95% band of "
        f"a new trial, at the median F_n. It reaches {'; '.join(reach)}."
    )


NEW_TRIAL_FIGURE = FigureSpec(
    "new_trial",
    "Predictive bands of a new trial",
    "Samples of traction force over slip velocity with the median and the band "
    "that holds 90 percent of a new trial, one panel per terrain.",
    draw_new_trial,
    caption_new_trial,
)
