"""The whole study rehearsed: recorded through the wire, analysed, held to bands."""

import contextlib
import os
import re
import subprocess
import sys
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from acquisition.errors import SessionError
from analysis.data.load import RecordedTrial, load_trial
from analysis.data.plausibility import doubts_of, doubts_of_record
from analysis.data.prepare import PrepareOptions
from analysis.data.terrain_kinds import FLAT
from analysis.study.models import GP_SE, TUSTIN, FitOptions
from analysis.study.study import Study, StudyOptions, run_study
from analysis.validation.bands import Band, BandResult, hold_against_bands
from analysis.validation.model_measures import measure_models
from analysis.validation.slip_measures import GroundTrials, measure_slips
from experiments.arguments import FRICTION
from experiments.report.truth_errors import compare_with_truth, z_scores
from experiments.session.store import list_sessions

WHOLE = 10  # trials per terrain from which every band applies
_OF_FEW = ("D", "E", "F", "T")  # groups that apply to fewer
_RUBS = 0.1  # share of friction from which there is something to compensate
_UNHINDERED = 0.02  # share of friction at which slips go back
_GOING_BACK = {"D5", "E3"}  # bands on slips that go back
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

# Beside the 43: not met unless frames, signs, tare and kinematics are right.
TRUTH_BANDS = (
    Band("T1", "v_t against the truth, rms, each terrain's worst trial (mm/s)", 0, 1.5),
    Band("T2", "F_t against the truth, mean |error|, all trials (N)", 0.2, 0.6),
    Band("T3", "F_n against the truth, mean |error|, all trials (N)", 0.2, 0.6),
    Band("T4", "error of mean F_t and F_n / uncertainty by the tares, rms", 0.8, 1.2),
)
# A rig without faults is not doubted; too few samples are, which E11 judges.
DOUBT_BAND = Band("T5", "trials that are doubted without a fault", 0, 0)


@dataclass(frozen=True, slots=True)
class AcceptancePlan:
    """What is rehearsed.

    Attributes:
        config: a rig.toml; None = as shipped.
        terrains: names of the terrains, in the matrix's order.
        plates: those of them without stones by the matrix; kept with the results.
        travel: length of the shortest container [m].
        trials: of each.
        seed: of everything random.
        friction: of the joints, as a share of what was identified on another arm.
        jobs: processes at a time; None = one per core.
        cables: resonance of the joints on their cables [Hz]; None = stiff ones.
        mount: turns of the true base about x, then y, then z [degrees]; None = none.
        wrong: name of the wrong rig that it is; "" = none.
    """

    config: Path | None
    terrains: tuple[str, ...]
    plates: tuple[str, ...]
    travel: float
    trials: int
    seed: int
    friction: float
    jobs: int | None
    cables: float | None = None
    mount: tuple[float, float, float] | None = None
    wrong: str = ""


def gated(plan: AcceptancePlan, results: Sequence[BandResult]) -> list[BandResult]:
    """Return the bands that decide.

    Slips hardly go back on an arm whose wrist rubs: beyond a share of 0.02 the bands
    on that are reported and do not decide. An arm that rubs more than the usual one is
    judged by nobody.
    """
    if plan.friction > FRICTION:
        return []
    if plan.friction <= _UNHINDERED:
        return list(results)
    return [result for result in results if result.band.id not in _GOING_BACK]


def calibrate_arm(plan: AcceptancePlan, data: Path) -> AcceptancePlan:
    """Return the plan for the arm whose friction was calibrated and is compensated.

    The calibration is the one of `traction calibrate friction`, in `data`/rig. A rig
    that somebody has described is taken as it is, as is one that hardly rubs.

    Raises:
        SessionError: the calibration failed; its words are in `data`.
    """
    if plan.config is not None or plan.friction < _RUBS:
        return plan
    data.mkdir(parents=True, exist_ok=True)
    folder, calibration = data / "rig", data / "calibration"
    config = folder / "rig.toml"
    simulated = ["--fake", "--fast", "--operator-script", "auto", "--no-color"]
    simulated += ["--seed", str(plan.seed), *_arm(plan)]
    simulated += ["--config", str(config), "--data", str(calibration)]
    steps = (["init", str(folder)], ["calibrate", "friction", *simulated])
    for step in steps:
        if code := _record(step, calibration):
            raise SessionError(
                f"traction {step[0]} ended with exit code {code}.",
                hint=f"What it said: {calibration}.log",
            )
    section = r'(\[friction\][^\[]*?model = )"none"([^\[]*?file = )"friction.toml"'
    used = r'\1"calibrated"\2"friction.fake.toml"'
    text, count = re.subn(section, used, config.read_text())
    assert count == 1
    config.write_text(text)
    return replace(plan, config=config)


def record_study(
    plan: AcceptancePlan, data: Path, say: Callable[[str], None] = lambda _: None
) -> None:
    """Record a session on every terrain into `data`, terrains side by side.

    Every session is the one that `traction run` makes, in a process of its own.

    Raises:
        SessionError: a session failed; its words are in `data`.
    """
    data.mkdir(parents=True, exist_ok=True)
    with _single_threaded(), _pool(plan.jobs) as pool:
        tasks = {
            pool.submit(_record, _arguments(plan, terrain, data), data / terrain): (
                terrain
            )
            for terrain in plan.terrains
        }
        for task in as_completed(tasks):
            terrain, code = tasks[task], task.result()
            if code:
                raise SessionError(
                    f"The session on {terrain} ended with exit code {code}.",
                    hint=f"What it said: {data / terrain}.log",
                )
            say(f"{terrain} recorded")


def analyse(plan: AcceptancePlan, data: Path) -> list[BandResult]:
    """Analyse the study in `data` and hold it against its bands.

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
    results = [*hold_against_bands(measures), *_truth(trials), doubts]
    if is_whole:
        return results
    return [f for f in results if f.band.id[0] in _OF_FEW and f.band.id != "E7"]


def as_plain(plan: AcceptancePlan, results: Sequence[BandResult]) -> dict[str, object]:
    """Return plan and findings as values for JSON."""
    return {
        "plan": {**asdict(plan), "config": str(plan.config or "shipped default")},
        "bands": [
            {**asdict(f.band), "values": list(f.values), "is_met": f.is_met}
            for f in results
        ],
    }


def _record(arguments: list[str], folder: Path) -> int:
    """Run one command of its own; what it says goes beside the data."""
    command = [sys.executable, "-m", "experiments", *arguments]
    with folder.with_name(folder.name + ".log").open("w") as log:
        return subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, check=False
        ).returncode


def _arguments(plan: AcceptancePlan, terrain: str, data: Path) -> list[str]:
    config = [] if plan.config is None else ["--config", str(plan.config)]
    return [
        "run",
        terrain,
        "--fake",
        "--fast",
        "--operator-script",
        "auto",
        "--trials",
        str(plan.trials),
        "--seed",
        str(plan.seed),
        "--data",
        str(data),
        "--no-color",
        *config,
        *_arm(plan),
    ]


def _arm(plan: AcceptancePlan) -> list[str]:
    """Return the options that say which arm is simulated."""
    kind = ["--friction", repr(plan.friction)]
    if plan.cables is not None:
        kind += ["--cables", repr(plan.cables)]
    if plan.mount is not None:
        kind += ["--mount", *map(repr, plan.mount)]
    return [*kind, "--wrong", plan.wrong] if plan.wrong else kind


def _pool(jobs: int | None) -> Executor:
    return ThreadPoolExecutor(jobs or os.cpu_count())


@contextlib.contextmanager
def _single_threaded() -> Generator[None]:
    """Let processes started meanwhile use one thread for linear algebra each."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


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
    """Return the rms of the errors over their uncertainty, one value of all forces."""
    scores = z_scores(trials)
    return (float(np.sqrt(np.mean(scores**2))),) if scores.size else ()
