"""What is seen in the figures beyond the paper's, said in sentences with numbers."""

from collections.abc import Sequence

import numpy as np

from analysis.figures.selection import representatives
from analysis.figures.uncertainty import BANDS, coverage_of
from analysis.findings.findings import StudyResults
from analysis.findings.surfaces import Surface
from analysis.findings.trends import MEAN_FORCE
from analysis.study.models import GP_SE, TITLES
from analysis.study.study import Study

_KEPT_PER_SECOND = 100


def say_mean(found: StudyResults) -> str:
    """Return how far the means reach."""
    said = [
        f"{surface.terrain} {surface.mean.min():.1f} to {surface.mean.max():.1f} N"
        for surface in _telling(found.study, found.surfaces)
    ]
    return (
        "First fold of each terrain, the same colours everywhere; dots are samples, "
        f"away from them the process falls back to its mean. {'; '.join(said)}."
    )


def say_variance(found: StudyResults) -> str:
    """Return how much the variances of stones and plates differ."""
    said = [
        f"{surface.terrain} {float(np.median(surface.variance)):.2g} N²"
        for surface in _telling(found.study, found.surfaces)
    ]
    return (
        "Variance of a measurement, noise included; logarithmic colours. Medians over "
        f"the map: {'; '.join(said)}."
    )


def say_coverage(found: StudyResults) -> str:
    """Return what the coverage map leaves out."""
    outside = sum(part.outside for part in found.coverage)
    total = outside + sum(float(part.counts.sum()) for part in found.coverage)
    return (
        f"Where the models have seen samples; white cells hold none. {outside} of "
        f"{total:.0f} samples lie beyond the axis of load."
    )


def say_calibration(found: StudyResults) -> str:
    """Return how far the bands are from what they promise."""
    shares = [
        (nominal, name, model, share)
        for key, nominal in BANDS
        for name, result in found.study.terrains.items()
        for model in found.study.options.fit.models
        if not np.isnan(share := coverage_of(result, model, key))
    ]
    parts = []
    for _, nominal in BANDS:
        mine = [entry for entry in shares if entry[0] == nominal]
        low = min(mine, key=lambda entry: entry[3])
        high = max(mine, key=lambda entry: entry[3])
        parts.append(
            f"{nominal:.0%} band: {low[3]:.0%} ({low[1]}, {TITLES[low[2]]}) to "
            f"{high[3]:.0%} ({high[1]}, {TITLES[high[2]]})"
        )
    return (
        "Share of held-out samples inside the central band, mean over trials; dashed: "
        f"what the band promises. {'; '.join(parts)}."
    )


def say_noise(found: StudyResults) -> str:
    """Return where input-dependent noise helps."""
    better = [
        f"{s.terrain} {-s.paired.difference:.3f} (p = {s.paired.p:.2g})"
        for s in found.noise
        if s.paired.difference < 0
    ]
    return (
        "Constant noise against noise chosen among the training trials of each fold: "
        "constant, log-linear in F_n and v_t, or that with heavy tails (Student's t). "
        "On the right: how many folds chose what, and NLPD before and after on trials "
        "left out; whiskers: standard error over trials. "
        + (f"Gain: {', '.join(better)}." if better else "It brings nothing here.")
    )


def say_confusion(level: str, found: StudyResults) -> str:
    """Return how many windows are recognised by either rule."""
    identification = found.identification
    if identification is None:
        return ""
    shares = [
        f"{size / _KEPT_PER_SECOND:g} s "
        f"{identification.by_density[size][level].accuracy:.2f} "
        f"({identification.by_error[size][level].accuracy:.2f})"
        for size in identification.sizes
    ]
    return (
        "Shares of the windows of each row in percent, by models that never saw the "
        "trial. Above: the largest log density; below: the paper's rule, the smallest "
        f"mean absolute error. Recognised (by the paper's rule): {', '.join(shares)}."
    )


def say_trials(found: StudyResults) -> str:
    """Return how many trials are shown."""
    count = sum(len(result.trials) for result in found.study.terrains.values())
    return (
        f"Smoothed traction of {count} trials, each from the far end to the near one; "
        "one scale for all terrains."
    )


def say_trends(found: StudyResults) -> str:
    """Return which terrains change from the first trial to the last."""
    changing = [
        f"{name} ({trend.slope:+.3f} ± {trend.slope_error:.3f} N per trial)"
        for name, trends in found.trends.items()
        if (trend := trends[MEAN_FORCE]).is_significant
    ]
    return (
        "Mean over the kept samples of each trial, in the order of recording; dashed: "
        "least-squares line, its slope with standard error. "
        + (
            f"More than two standard errors: {', '.join(changing)}. By chance alone, "
            "about one terrain in thirteen shows such a slope in ten trials."
            if changing
            else "No slope exceeds two standard errors: no wear is seen."
        )
    )


def say_residuals(found: StudyResults) -> str:
    """Return how large bias and spread of the residuals are."""
    said = [
        f"{name} {bands[GP_SE].bias:+.2f} ± {bands[GP_SE].sd:.2f} N"
        for name, bands in found.residuals.items()
        if GP_SE in bands
    ]
    return (
        "Median (thick), 5 and 95 % quantiles (thin) of measured minus predicted force "
        "on trials left out, in ten bins of velocity."
        + (f" Mean and standard deviation, GP (SE): {'; '.join(said)}." if said else "")
    )


def say_stick_slip(found: StudyResults) -> str:
    """Return how long slips are."""
    said = []
    for result in representatives(found.study):
        slips = [slip.length for trial in result.slips for slip in trial]
        if slips:
            said.append(
                f"{result.terrain}: {len(slips)} slips, median "
                f"{1e3 * float(np.median(slips)):.0f} mm"
            )
        else:
            said.append(f"{result.terrain}: no slip")
    return (
        "The trial with most slips of one terrain per class: force builds up over "
        f"millimetres and breaks down in a slip (shaded). {'; '.join(said)}."
    )


def say_timing(found: StudyResults) -> str:
    """Return the longest period and the usual age of a force sample."""
    longest = max(trial.longest_gap for trial in found.rig)
    missed = sum(trial.missed for trial in found.rig)
    cycles = sum(trial.cycles for trial in found.rig)
    skews = [trial.skew[1] for trial in found.rig]
    return (
        f"{cycles} cycles, {missed} missed, longest period {longest:.2f} ms. When the "
        f"joints have answered, the force sample is {np.median(skews):.2f} ms old "
        f"(median over trials; {min(skews):.2f} to {max(skews):.2f} ms)."
    )


def say_rig(found: StudyResults) -> str:
    """Return the largest motion of joint 7 and the largest change of tare."""
    joint7 = max(found.rig, key=lambda trial: trial.joint7)
    parts = [f"Joint 7 moved at most {joint7.joint7:.1f} mrad ({joint7.name})"]
    brackets = [t.tare_bracket for t in found.rig if t.tare_bracket is not None]
    if brackets:
        parts.append(f"the tare changed by at most {max(brackets):.2f} N to the next")
    return (
        f"{'; '.join(parts)}. Dashed: motion of joint 7 that is warned of. Change of "
        "tare: to the next trial's. Load: median F_n of the moving foot less the "
        "weight of the virtual mass."
    )


def _telling(study: Study, surfaces: Sequence[Surface]) -> list[Surface]:
    """Return the surfaces of one terrain per class."""
    names = {result.terrain for result in representatives(study)}
    return [surface for surface in surfaces if surface.terrain in names]
