"""Analysis settings and provenance."""

import numpy as np

from acquisition.clock import RATE_HZ
from analysis.report.page_model import ReportContext, Section
from analysis.report.results import StudyResults
from analysis.report.section import ReportSection, ReportTable
from analysis.study.crossval import MOST_FOLDS
from analysis.study.study import Study
from analysis.tustin.model import SYMBOLS


def settings_table(study: Study, *, is_foreign: bool) -> ReportTable:
    """Return the table of all settings of the analysis."""
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
            f"one length per input, at most {fit.gp_points} samples chosen at random "
            f"(seed {fit.seed}); marginal likelihood, maximised from several starting "
            "points",
        ],
        [
            "noise of the GP",
            "constant in the five models of Fig. 9; a further model chooses per fold "
            "among constant, log-linear and Student's t, by held-out training trials",
        ],
        ["across terrains", "the model of fold k tested on trial k, wrapping around"],
        ["recorded rate", _rates(study)],
    ]
    note = "External data: not recorded by this rig." if is_foreign else ""
    return ReportTable("Choices", ("what", "how"), rows, note)


def _widths(study: Study) -> list[list[str]]:
    """Describe smoothing and thinning, in time and in samples."""
    prepare = study.options.prepare
    trials = [trial for result in study.terrains.values() for trial in result.trials]
    used = sorted({trial.widths for trial in trials if not trial.is_prepared})
    averaged = " or ".join(str(width) for width in sorted({w for w, _ in used}))
    thinned = " or ".join(str(every) for every in sorted({e for _, e in used}))
    prepared = sum(trial.is_prepared for trial in trials)
    remark = f"; {prepared} trials had been prepared already" if prepared else ""
    span, step = (1e3 * n / RATE_HZ for n in (prepare.smoothing, prepare.downsample))
    return [
        [
            "smoothing",
            f"centred moving average over {span:g} ms: {averaged or 'no'} samples"
            + remark,
        ],
        [
            "downsampling",
            f"a sample every {step:g} ms, after smoothing: one in {thinned or '1'}"
            + remark,
        ],
    ]


def _folds(study: Study) -> str:
    """Describe the folds."""
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


def _tables(results: StudyResults, context: ReportContext) -> list[ReportTable]:
    return [settings_table(results.study, is_foreign=context.is_foreign)]


SECTION = Section(ReportSection.ORIGIN, _tables)
