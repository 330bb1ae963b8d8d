"""Analysis of the rehearsed study, compared with its bands."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from analysis.data.load import RecordedTrial, load_trial
from analysis.data.plausibility import doubts_of, doubts_of_record
from analysis.data.prepare import PrepareOptions
from analysis.data.terrain_kinds import FLAT
from analysis.study.models import GP_SE, TUSTIN, FitOptions
from analysis.study.study import Study, StudyOptions, run_study
from experiments.arguments import FRICTION
from experiments.rehearsal.bands import Band, BandResult, compare_with_bands
from experiments.rehearsal.model_measures import measure_models
from experiments.rehearsal.plan import AcceptancePlan
from experiments.rehearsal.slip_measures import GroundTrials, measure_slips
from experiments.report.truth_errors import compare_with_truth, z_scores
from experiments.session.store import list_sessions

WHOLE = 10  # trials per terrain from which every band applies
_OF_FEW = ("D", "E", "F", "T")  # groups that apply with fewer trials
_UNHINDERED = 0.02  # largest share of friction with bounce-back of slips
_BOUNCE_BACK = {"D5", "E3"}  # bands on bounce-back

# Further bands, met only if frames, signs, tare and kinematics are right.
TRUTH_BANDS = (
    Band("T1", "v_t against the truth, rms, each terrain's worst trial (mm/s)", 0, 1.5),
    Band("T2", "F_t against the truth, mean |error|, all trials (N)", 0.2, 0.6),
    Band("T3", "F_n against the truth, mean |error|, all trials (N)", 0.2, 0.6),
    Band("T4", "error of mean F_t and F_n / uncertainty by the tares, rms", 0.8, 1.2),
)
# A rig without faults causes no doubts, except about too few samples (E11).
DOUBT_BAND = Band("T5", "trials that are doubted without a fault", 0, 0)


def deciding_bands(
    plan: AcceptancePlan, results: Sequence[BandResult]
) -> list[BandResult]:
    """Return the bands that decide.

    Friction of the wrist suppresses bounce-back: beyond a share of 0.02 its bands are
    reported but do not decide. With more friction than the usual arm no band decides.
    """
    if plan.friction > FRICTION:
        return []
    if plan.friction <= _UNHINDERED:
        return list(results)
    return [result for result in results if result.band.id not in _BOUNCE_BACK]


def analyse(plan: AcceptancePlan, data: Path) -> list[BandResult]:
    """Analyse the study in `data` and compare it with its bands.

    With fewer than ten trials only the bands on slips, samples and truth are returned.
    """
    trials = _load(plan, data)
    series = {
        name: [trial.series() for trial in group] for name, group in trials.items()
    }
    is_whole = plan.trials >= WHOLE
    options = StudyOptions(
        prepare=PrepareOptions(container_travel=plan.travel),
        fit=FitOptions(
            seed=plan.seed, models=(TUSTIN, GP_SE) if is_whole else (TUSTIN,), draws=0
        ),
        n_jobs=plan.jobs,
    )
    study = run_study(series, options, simulated=True)
    measures = {
        **(measure_models(study) if is_whole else {}),
        **measure_slips(_grounds(study, trials)),
    }
    doubted = sum(
        bool([*doubts_of(prepared), *doubts_of_record(recorded)])
        for name, result in study.terrains.items()
        for prepared, recorded in zip(result.trials, trials[name], strict=True)
    )
    doubts = BandResult(DOUBT_BAND, (doubted,))
    results = [*compare_with_bands(measures), *_truth(trials), doubts]
    if is_whole:
        return results
    return [f for f in results if f.band.id[0] in _OF_FEW and f.band.id != "E7"]


def results_to_json(
    plan: AcceptancePlan, results: Sequence[BandResult]
) -> dict[str, object]:
    """Return plan and results as values for JSON."""
    return {
        "plan": {**asdict(plan), "config": str(plan.config or "shipped default")},
        "bands": [
            {**asdict(f.band), "values": list(f.values), "is_met": f.is_met}
            for f in results
        ],
    }


def _load(plan: AcceptancePlan, data: Path) -> dict[str, list[RecordedTrial]]:
    trials: dict[str, list[RecordedTrial]] = {name: [] for name in plan.terrains}
    for session in list_sessions(data):
        trials[session.terrain] += [load_trial(path) for path in session.kept_trials()]
    return trials


def _grounds(
    study: Study, trials: dict[str, list[RecordedTrial]]
) -> dict[str, GroundTrials]:
    return {
        name: GroundTrials(
            is_plate=result.kind == FLAT,
            series=tuple(trial.series() for trial in trials[name]),
            prepared=result.trials,
            slips=result.slips,
        )
        for name, result in study.terrains.items()
    }


def _truth(trials: dict[str, list[RecordedTrial]]) -> list[BandResult]:
    errors = {
        name: [e for trial in group if (e := compare_with_truth(trial)) is not None]
        for name, group in trials.items()
    }
    every = [error for group in errors.values() for error in group]
    if not every:
        return [BandResult(band, ()) for band in TRUTH_BANDS]
    values = (
        tuple(1e3 * max(e.v_t for e in group) for group in errors.values() if group),
        (float(np.mean([e.F_t for e in every])),),
        (float(np.mean([e.F_n for e in every])),),
        _predicted([trial for group in trials.values() for trial in group]),
    )
    return [BandResult(*pair) for pair in zip(TRUTH_BANDS, values, strict=True)]


def _predicted(trials: Sequence[RecordedTrial]) -> tuple[float, ...]:
    """Rms of the errors divided by their uncertainty, one value for all forces."""
    scores = z_scores(trials)
    return (float(np.sqrt(np.mean(scores**2))),) if scores.size else ()
