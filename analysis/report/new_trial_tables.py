"""Tables of the report about a trial that nobody has recorded yet."""

from analysis.figures.sections import ReportSection
from analysis.findings.findings import StudyResults
from analysis.report.page_model import ReportTable
from analysis.study.metrics import compare
from analysis.study.models import GP_SE_NOISE, GP_SE_TRIAL
from analysis.study.new_trial import NewTrialModel, family_counts
from analysis.study.study import Study
from analysis.study.terrain_fit import mean_of
from analysis.study.trial_components import TrialComponents

_LEAST = (
    0.01  # of the residual within a trial: smaller noise is not distinguishable from 0
)


def new_trial_tables(results: StudyResults) -> list[ReportTable]:
    """Return the tables on predictions of a new trial; one without rows is left out."""
    tables = [
        family_table(results.study),
        worth_table(results.study),
        oracle_table(results),
    ]
    return [table for table in tables if table.rows]


def family_table(study: Study) -> ReportTable:
    """Return which family of distributions the trials chose, and what it gains."""
    rows: list[list[str]] = []
    for name, result in study.terrains.items():
        fitted = [fold.model for fold in result.models(GP_SE_TRIAL)]
        models = [model for model in fitted if isinstance(model, NewTrialModel)]
        if not models:
            continue
        counts = family_counts(models)
        before, after = (result.scores(m, "nlpd") for m in (GP_SE_NOISE, GP_SE_TRIAL))
        paired, mean = compare(before, after), mean_of(after)
        rows.append(
            [
                name,
                ", ".join(f"{family} {n}" for family, n in counts.items() if n),
                str(sum(model.shape is not None for model in models)),
                str(sum(model.choice.clipped for model in models)),
                "–" if mean is None else f"{mean:.3f}",
                "–" if paired is None else f"{-paired.difference:+z.3f}",
            ]
        )
    return ReportTable(
        name="Predictive distribution of a new trial",
        header=(
            "terrain",
            "family by folds",
            "with shape by folds",
            "rows clipped",
            "NLPD [nat]",
            "gain over chosen noise [nat]",
        ),
        rows=rows,
        note="A Gaussian process with an effect of the trial. Normal noise, noise that "
        "changes with load and velocity, or normal noise of the warped force "
        "c log(F_t + c): chosen in every fold among its training trials, each left "
        "out in turn. Scores are of trials left out of the fold.",
        section=ReportSection.BEYOND,
    )


def worth_table(study: Study) -> ReportTable:
    """Return how trials differ, and how well so many show a terrain's level."""
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
        "between trials is by moments from 30 trials on, else by the restricted "
        "likelihood; where the two differ by more than twice the standard error, it "
        "says so.",
        section=ReportSection.BEYOND,
    )


def oracle_table(results: StudyResults) -> ReportTable:
    """Return bands of a new trial beside those that assume no distribution."""
    rows = [
        [
            shares.terrain,
            f"{band.nominal:.0%}",
            f"{band.coverage:.1%} ± {band.coverage_error:.1%}",
            f"{band.width:.2f}",
        ]
        for shares in results.shares
        for band in shares.oracle
    ]
    return ReportTable(
        name="Distribution-free bands (conformal)",
        header=("terrain", "band", "coverage", "width over the model's"),
        rows=rows,
        note="A band around the median, its width calibrated on the other held-out "
        "trials, one score per trial (conformal over trials). Its coverage has to "
        "reach the nominal share; a width near 1 means that the model's own band is "
        "calibrated. A 95% band needs at least nineteen trials.",
        section=ReportSection.BEYOND,
    )


def _between(components: TrialComponents) -> str:
    if not components.is_distinguishable:
        return f"not distinguishable from 0 (gain {components.gain:.1f})"
    shown = f"{_with_interval(components, 'between', 'N')} (gain {components.gain:.1f})"
    if components.do_differ and components.other is not None:
        return f"{shown}; the other way gives {components.other:.2f} N"
    return shown


def _measurement(components: TrialComponents) -> str:
    if components.measurement < _LEAST * components.within:  # the search ends there
        return "not distinguishable from 0"
    return _with_interval(components, "measurement", "N")


def _with_interval(components: TrialComponents, name: str, unit: str) -> str:
    value, interval = getattr(components, name), components.intervals.get(name)
    if interval is None:
        return f"{value:.2f} {unit}"
    return f"{value:.2f} ({interval.lower:.2f} to {interval.upper:.2f}) {unit}"
