"""Tables about where numbers come from: the rig, and the choices of the analysis."""

from collections.abc import Callable, Sequence

import numpy as np

from acquisition.clock import RATE_HZ
from analysis.figures.sections import ReportSection
from analysis.findings.findings import StudyResults
from analysis.findings.rig_health import RigTrial
from analysis.report.page_model import ReportTable
from analysis.study.crossval import MOST_FOLDS
from analysis.study.study import Study
from analysis.tustin.model import SYMBOLS

_SATURATED = 1e-9  # share of cycles

_REACH_NOTE = (
    "Measurable: by the sensor's ranges and the lever of the foot; – where "
    "unknown: without a sample out of range it is at least the largest observed. "
    "Uncertainty: standard uncertainty of a trial's mean F_t and F_n, "
    "from the changes between the tares of its session; "
    "with the zero between two tares (drift=interpolated) "
    "it is four fifths of that. Floor: mean |error| of smoothed "
    "F_t by these changes and by the noise at rest, which no model can be better than; "
    "by the noise alone where a session has one tare only. "
    "Drag: Coulomb friction of the joints as seen by the hand's push, "
    "from the recorded friction calibration, less the compensation; "
    "without a calibration, from the arm model. F_t and F_n are measured at the wrist, "
    "below the joints, and v_t at the joints: friction biases no model, but limits the "
    "loads and speeds that are reached. Medians over trials."
)


def rig_tables(results: StudyResults) -> list[ReportTable]:
    """Return rig health by trial and its reach by terrain; none without a rig."""
    return [health(results.rig), reach(results)] if results.rig else []


def health(rig: Sequence[RigTrial]) -> ReportTable:
    """Return one line per trial."""
    return ReportTable(
        "Rig health by trial",
        (
            "trial",
            "period, median [ms]",
            "longest [ms]",
            "missed",
            "force sample's age, 5 to 95% [ms]",
            "tare x, y, z [N]",
            "change of tare [N]",
            "joint 7 [mrad]",
            "pucks [°C]",
            "motors [°C]",
            "mean |F_y| moving [N]",
        ),
        [
            (
                f"{trial.terrain} {trial.name}",
                f"{trial.period:.3f}",
                f"{trial.longest_gap:.2f}",
                str(trial.missed),
                f"{trial.skew[0]:.2f} to {trial.skew[2]:.2f}",
                ", ".join(f"{value:.2f}" for value in trial.tare),
                _number(trial.tare_bracket),
                f"{trial.joint7:.1f}",
                _range(trial.puck_degc),
                _range(trial.motor_degc),
                _number(trial.lateral),
            )
            for trial in rig
        ],
        note="Age: how much earlier the force was sampled than the joints answered. "
        "Change of tare: distance to the offset of the next tare, which "
        "brackets the drift of the sensor. – where it is not known.",
        section=ReportSection.HEALTH,
    )


def reach(results: StudyResults) -> ReportTable:
    """Return for every terrain what the rig could have seen, beside the errors."""
    rows = []
    for name, result in results.study.terrains.items():
        trials = [trial for trial in results.rig if trial.terrain == name]
        if not trials:
            continue
        errors = [
            mae
            for model in results.study.options.fit.models
            if (mae := result.mae(model)) is not None
        ]
        floor = _median(trials, lambda trial: trial.floor)
        ratio = min(errors) / floor if errors and floor else None
        rows.append(
            (
                name,
                _largest(trials),
                _number(_median(trials, lambda trial: trial.measurable_F_t), 0),
                _number(floor),
                _number(_median(trials, lambda trial: trial.tare_bracket)),
                _number(_median(trials, lambda trial: trial.force_uncertainty)),
                _number(min(errors, default=None)),
                _number(ratio, 1),
                _number(_median(trials, lambda trial: trial.load_bias)),
                _number(_median(trials, lambda trial: trial.drag)),
            )
        )
    return ReportTable(
        "Limits of the rig and results",
        (
            "terrain",
            "largest |F_t| observed [N]",
            "measurable [N]",
            "sensor floor [N]",
            "drift of the tare [N]",
            "uncertainty of mean F_t, F_n [N]",
            "best model's error [N]",
            "error over floor",
            "F_n above set load [N]",
            "drag of the joints [N]",
        ),
        rows,
        note=_REACH_NOTE,
        section=ReportSection.REACH,
    )


def _largest(trials: Sequence[RigTrial]) -> str:
    largest = max(trial.largest_F_t for trial in trials)
    share = float(np.mean([trial.saturated for trial in trials]))
    if share > _SATURATED:
        return f"{largest:.1f}, out of range in {share:.2%} of cycles"
    return f"{largest:.1f}, none out of range"


def _median(
    trials: Sequence[RigTrial], measure: Callable[[RigTrial], float | None]
) -> float | None:
    values = [value for trial in trials if (value := measure(trial)) is not None]
    return float(np.median(values)) if values else None


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _range(values: Sequence[float]) -> str:
    if not values:
        return "–"
    low, high = min(values), max(values)
    return f"{low:.0f}" if low == high else f"{low:.0f} to {high:.0f}"


def choices(study: Study, *, is_foreign: bool) -> ReportTable:
    """Return every choice of the analysis."""
    prepare, fit = study.options.prepare, study.options.fit
    box = ", ".join(
        f"{SYMBOLS[name]} {low:g} to {high:g}"
        for name, (low, high) in fit.bounds.items()
    )
    rows = [
        *_widths(study),
        ["window", f"{prepare.slowest:g} ≤ v_t ≤ {prepare.fastest:g} m/s"],
        ["folds", _folds(study)],
        ["Tustin fit", f"least squares on all kept samples; bounds {box}"],
        [
            "GP fit",
            f"squared exponential, one length per input, at most {fit.gp_points} "
            f"samples chosen at random (seed {fit.seed}), marginal likelihood, three "
            "starts",
        ],
        [
            "noise of the GP",
            "constant in the five models of Fig. 9; beside them chosen per fold among "
            "constant, log-linear and Student's t, by trials left out of the training",
        ],
        ["across terrains", "the model of fold k tested on trial k, wrapping round"],
        ["recorded rate", _rates(study)],
    ]
    note = "External data: not recorded by this rig." if is_foreign else ""
    return ReportTable("Choices", ("what", "how"), rows, note)


def _widths(study: Study) -> list[list[str]]:
    """Return how samples were smoothed and thinned, in time and in samples."""
    prepare = study.options.prepare
    trials = [trial for result in study.terrains.values() for trial in result.trials]
    used = sorted({trial.widths for trial in trials if not trial.is_prepared})
    averaged = " or ".join(str(width) for width in sorted({w for w, _ in used}))
    thinned = " or ".join(str(every) for every in sorted({e for _, e in used}))
    prepared = sum(trial.is_prepared for trial in trials)
    rest = f"; {prepared} trials were prepared before" if prepared else ""
    span, step = (1e3 * n / RATE_HZ for n in (prepare.smoothing, prepare.downsample))
    return [
        [
            "smoothing",
            f"centred moving average over {span:g} ms: {averaged or 'no'} samples"
            + rest,
        ],
        [
            "downsampling",
            f"a sample every {step:g} ms, after smoothing: one in {thinned or '1'}"
            + rest,
        ],
    ]


def _folds(study: Study) -> str:
    """Return what a fold leaves out, in words."""
    sizes = [len(f.left_out) for r in study.terrains.values() for f in r.folds]
    if max(sizes, default=1) == 1:
        return "one whole trial left out at a time"
    return (
        f"one whole trial left out at a time; beyond {MOST_FOLDS} trials of a terrain "
        f"a group of {min(s for s in sizes if s > 1)} to {max(sizes)} of them, every "
        f"{MOST_FOLDS}th, each scored by itself"
    )


def _rates(study: Study) -> str:
    rates = [
        1.0 / float(np.median(np.diff(trial.smooth.t)))
        for result in study.terrains.values()
        for trial in result.trials
    ]
    low, high = min(rates), max(rates)
    return f"{low:.0f} Hz" if high < 1.01 * low else f"{low:.0f} to {high:.0f} Hz"
