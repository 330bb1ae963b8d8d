"""Quantities for the paper's statements about trials: sticking, slips, velocities."""

from collections.abc import Sequence

import numpy as np

from analysis.data.events import Slip
from analysis.report.sections.paper.evidence import PaperEvidence
from analysis.report.sections.paper.quantities import ClaimResult, ends_of
from analysis.study.terrain_fit import TerrainResult, mean_of

_LOW = 0.3  # floor relative to the preceding peak


def sticking(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the share of sticking samples within the force bound."""
    parts, numbers = [], {}
    for kind, results in (("stones", evidence.stones), ("plates", evidence.plates)):
        names = [result.terrain for result in results]
        entries = [entry for entry in evidence.sticking if entry.terrain in names]
        if not entries:
            continue
        printed = [entry.as_printed for entry in entries]
        static = [entry.with_static for entry in entries]
        parts.append(
            f"{kind}: |F_t| ≤ μ F_n in {ends_of(printed, '.0%')} of a terrain's "
            f"sticking samples, |F_t| ≤ max(F_s, μ F_n) in {ends_of(static, '.0%')}"
        )
        numbers[f"as printed, {kind}"] = min(printed)
        numbers[f"with F_s, {kind}"] = min(static)
    if not parts:
        return None
    shares = [value for name, value in numbers.items() if name.startswith("as")]
    ends = {"smallest share": min(shares), "largest share": max(shares)}
    return ClaimResult(f"{'; '.join(parts)}.", numbers, ends)


def floor(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the floor of the force in slips on stones relative to the peak."""
    ratios = [slip.floor / slip.peak for slip in _slips_of(evidence.stones)]
    if not ratios:
        return None
    middle, low = float(np.median(ratios)), float(np.mean(np.less(ratios, _LOW)))
    text = (
        f"Median floor {middle:.0%} of the peak before; below {_LOW:.0%} of it in "
        f"{low:.0%} of {len(ratios)} slips."
    )
    return ClaimResult(text, {"median floor": middle, "below 30%": low})


def bounce(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the share of slips on stones with a bounce-back."""
    slips, on_plates = _slips_of(evidence.stones), _slips_of(evidence.plates)
    if not slips:
        return None
    bounces = [sum(s.has_bounce for s in group) for group in (slips, on_plates)]
    share = bounces[0] / len(slips)
    text = f"{bounces[0]} of {len(slips)} slips on stones ({share:.0%})"
    if on_plates:
        text += f"; {bounces[1]} of {len(on_plates)} on plates"
    elif evidence.plates:
        text += "; no slip on plates"
    numbers = {"slips": len(slips), "bounce-backs": bounces[0], "share": share}
    return ClaimResult(f"{text}.", numbers)


def spike(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the force spike in bounce-backs on stones relative to the peak."""
    slips = _slips_of(evidence.stones)
    spikes = [slip.spike / slip.peak for slip in slips if slip.spike is not None]
    if not spikes:
        return None
    middle = float(np.median(spikes))
    text = (
        f"The force rises by {middle:.0%} of the peak before the slip (median of "
        f"{len(spikes)} bounce-backs)."
    )
    return ClaimResult(text, {"median spike": middle})


def sag(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the share of slips on stones preceded by a force decrease."""
    slips = _slips_of(evidence.stones)
    if not slips:
        return None
    count = sum(slip.has_sag for slip in slips)
    share = count / len(slips)
    text = (
        f"{count} of {len(slips)} slips on stones ({share:.0%}) follow such a decrease."
    )
    return ClaimResult(text, {"share": share})


def window(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the share of samples in the window, of all and of the moving ones."""
    results = [*evidence.stones, *evidence.plates]
    shares = [[trial.shares for trial in result.trials] for result in results]
    every = [float(np.mean([s.window for s in row])) for row in shares]
    moving = [mean_of([s.window_of_moving for s in row]) or 0.0 for row in shares]
    if not every:
        return None
    text = (
        f"{ends_of(every, '.0%')} of all samples of a terrain, "
        f"{ends_of(moving, '.0%')} of the moving ones."
    )
    return ClaimResult(text, {"all": min(every), "moving": min(moving)})


def _slips_of(results: Sequence[TerrainResult]) -> list[Slip]:
    return [slip for result in results for trial in result.slips for slip in trial]
