"""Tests of covariates: does a column of the trials improve the prediction of F_t?"""

from collections.abc import Iterable, Mapping, Sequence

from analysis.data.prepare import prepare_trial
from analysis.data.recorded_covariates import RECORDED, with_covariates
from analysis.data.series import TractionSeries
from analysis.report.reduced_trial import TrialFiles
from analysis.study.covariates import (
    FEWEST,
    TRAVEL,
    CovariateResult,
    CovariateRows,
    covariate_results,
    least_drop,
)
from analysis.study.store import ResultStore
from analysis.study.study import Study
from analysis.study.tasks import Workers
from experiments.operator.console import WARNING, Console

KNOWN = (*RECORDED, TRAVEL)  # columns of recordings


def columns_tested(
    study: Study,
    trials: Mapping[str, Iterable[TractionSeries]],
    columns: Sequence[str],
    console: Console,
    store: ResultStore | None = None,
) -> list[CovariateResult]:
    """Test columns on every terrain; returns and prints the results.

    Args:
        study: study of the trials, whose choices the test uses.
        trials: trials by terrain, with the columns among their further inputs.
        columns: names of the columns.
        console: output.
        store: results of earlier runs.
    """
    if not columns:
        return []
    console.say(f"Does F_t follow from {', '.join(columns)}? fitting ...")
    options = study.options
    rows: dict[str, list[CovariateRows]] = {}
    for name, group in trials.items():
        least = least_drop(study.kinds[name])
        prepared = (prepare_trial(series, options.prepare) for series in group)
        rows[name] = [CovariateRows.of(t, columns, least) for t in prepared if t.kept]
    workers = Workers(options.n_jobs, options.scheduler)
    results = covariate_results(rows, columns, options.fit, workers, store)
    for result in results:
        console.say(result.sentence)
    tested = {(result.terrain, result.column) for result in results}
    for name, group in rows.items():
        if lacking := [c for c in columns if (name, c) not in tested]:
            why = (
                f"{len(group)} trials with samples, it takes {FEWEST}"
                if len(group) < FEWEST
                else "no model could be fitted with it"
            )
            console.say(f"{WARNING} {name}: {', '.join(lacking)}: not tested ({why}).")
    return results


def recorded_columns(
    files: Mapping[str, TrialFiles], columns: Sequence[str]
) -> dict[str, Iterable[TractionSeries]]:
    """Return recorded trials with covariates, read again one by one."""
    asked = [name for name in columns if name in RECORDED]
    return {
        name: (with_covariates(trial, asked) for trial in group)
        for name, group in files.items()
    }
