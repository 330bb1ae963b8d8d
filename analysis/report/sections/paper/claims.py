"""The checkable statements of the paper, each held against a study.

A statement agrees, partly or not, by a limit that stands beside it; one whose terrains
the study lacks cannot be shown.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.report.sections.paper import model_claims
from analysis.report.sections.paper.measures import (
    Agreement,
    ClaimResult,
    PaperEvidence,
    ends_of,
    graded,
    more_rows_claim,
    signs_of_b,
    slips_of,
)
from analysis.study.terrain_fit import mean_of

_HOLDS = 0.95  # share from which a bound holds
_NEAR_ZERO, _LOW = 0.25, 0.3  # of the peak before


@dataclass(frozen=True, slots=True)
class PaperClaim:
    """One statement of the paper beside what the study shows.

    Attributes:
        reference: where the paper makes it.
        statement: what it says.
        shown: what this study shows, or what is missing.
        agreement: whether the two agree.
        numbers: of `shown`, SI units, shares as 1.
    """

    reference: str
    statement: str
    shown: str
    agreement: Agreement
    numbers: Mapping[str, float]


class _Statement(NamedTuple):
    """A statement of the paper, what it takes to show it, and how."""

    reference: str
    text: str
    needs: str
    show: Callable[[PaperEvidence], ClaimResult | None]


def paper_claims(evidence: PaperEvidence) -> list[PaperClaim]:
    """Return every statement.

    None for one terrain, which makes no comparison, nor for terrains that are not the
    paper's.
    """
    terrains = evidence.study.terrains.values()
    if len(terrains) < 2 or not all(terrain.is_papers for terrain in terrains):
        return []
    return [_held(evidence, statement) for statement in _STATEMENTS]


def _held(evidence: PaperEvidence, statement: _Statement) -> PaperClaim:
    reference, text, needs, show = statement
    shown = show(evidence)
    if shown is None:
        missing = f"Not testable in this study: it needs {needs}."
        return PaperClaim(reference, text, missing, Agreement.OPEN, {})
    return PaperClaim(reference, text, *shown)


def _sticking(evidence: PaperEvidence) -> ClaimResult | None:
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
    agreement = graded(min(shares) >= _HOLDS, is_partly=max(shares) >= _HOLDS)
    return ClaimResult(f"{'; '.join(parts)}.", agreement, numbers)


def _floor(evidence: PaperEvidence) -> ClaimResult | None:
    ratios = [slip.floor / slip.peak for slip in slips_of(evidence.stones)]
    if not ratios:
        return None
    middle, low = float(np.median(ratios)), float(np.mean(np.less(ratios, _LOW)))
    text = (
        f"Median floor {middle:.0%} of the peak before; below {_LOW:.0%} of it in "
        f"{low:.0%} of {len(ratios)} slips."
    )
    numbers = {"median floor": middle, "below 30%": low}
    return ClaimResult(text, graded(middle < _NEAR_ZERO, is_partly=low > 0.5), numbers)


def _bounce(evidence: PaperEvidence) -> ClaimResult | None:
    slips, on_plates = slips_of(evidence.stones), slips_of(evidence.plates)
    if not slips:
        return None
    thrown = [sum(s.has_bounce for s in group) for group in (slips, on_plates)]
    share = thrown[0] / len(slips)
    text = f"{thrown[0]} of {len(slips)} slips on stones ({share:.0%})"
    if on_plates:
        text += f"; {thrown[1]} of {len(on_plates)} on plates"
    elif evidence.plates:
        text += "; no slip on plates"
    numbers = {"slips": len(slips), "bounce-backs": thrown[0], "share": share}
    return ClaimResult(
        f"{text}.", graded(share > 1 / 3, is_partly=share > 0.0), numbers
    )


def _spike(evidence: PaperEvidence) -> ClaimResult | None:
    slips = slips_of(evidence.stones)
    spikes = [slip.spike / slip.peak for slip in slips if slip.spike is not None]
    if not spikes:
        return None
    middle = float(np.median(spikes))
    text = (
        f"The force rises by {middle:.0%} of the peak before the slip (median of "
        f"{len(spikes)} bounce-backs)."
    )
    return ClaimResult(text, graded(middle > 0.2), {"median spike": middle})


def _sag(evidence: PaperEvidence) -> ClaimResult | None:
    slips = slips_of(evidence.stones)
    if not slips:
        return None
    count = sum(slip.has_sag for slip in slips)
    share = count / len(slips)
    text = f"{count} of {len(slips)} slips on stones ({share:.0%}) follow such a sag."
    return ClaimResult(
        text, graded(share > 0.5, is_partly=share > 0.08), {"share": share}
    )


def _window(evidence: PaperEvidence) -> ClaimResult | None:
    results = [*evidence.stones, *evidence.plates]
    shares = [[trial.shares for trial in result.trials] for result in results]
    every = [float(np.mean([s.window for s in row])) for row in shares]
    moving = [mean_of([s.window_of_moving for s in row]) or 0.0 for row in shares]
    if not every:
        return None
    text = (
        f"{ends_of(every, '.0%')} of all samples of a terrain, "
        f"{ends_of(moving, '.0%')} of those that move."
    )
    agreement = graded(min(every) > 0.5, is_partly=min(moving) > 0.5)
    return ClaimResult(text, agreement, {"all": min(every), "moving": min(moving)})


_STATEMENTS: Sequence[_Statement] = (
    _Statement(
        "eq. 2",
        "While the foot sticks, |F_t| ≤ μ F_n.",
        "stones or plates that stick",
        _sticking,
    ),
    _Statement(
        "IV, Fig. 4",
        "In a slip the traction force drops to near zero.",
        "slips on stones",
        _floor,
    ),
    _Statement(
        "IV, Fig. 4",
        "The foot bounces back after slips (two of the three printed).",
        "slips on stones",
        _bounce,
    ),
    _Statement(
        "IV, Fig. 4",
        "Bounce-back comes with an opposing spike of the force.",
        "bounce-backs on stones",
        _spike,
    ),
    _Statement(
        "IV, Fig. 4",
        "F_t decreases before a slip (two of the three printed).",
        "slips on stones",
        _sag,
    ),
    _Statement(
        "IV",
        "The window of velocities holds the majority of the data.",
        "stones or plates",
        _window,
    ),
    _Statement(
        "Table I",
        "The viscous coefficient b is negative on stones, positive on plates.",
        "stones and plates",
        signs_of_b,
    ),
    _Statement(
        "Table I",
        "On stones δ_s is near zero: a straight line, no Stribeck shape.",
        "stones",
        model_claims.shapeless_stones,
    ),
    _Statement(
        "IV-B",
        "More than 300 training points do not increase the accuracy.",
        "trials with more rows than a process was given",
        more_rows_claim,
    ),
    _Statement(
        "II-B",
        "The NN covariance adapts better to non-smooth data.",
        "stones",
        model_claims.kernels_on_stones,
    ),
    _Statement(
        "IV-C, Fig. 9",
        "The models perform similarly on stones.",
        "stones",
        model_claims.alike_on_stones,
    ),
    _Statement(
        "IV-C, Fig. 9",
        "The models perform similarly on plates.",
        "plates",
        model_claims.alike_on_plates,
    ),
    _Statement(
        "IV-C, Fig. 9",
        "The error is much higher on stones than on plates.",
        "stones and plates",
        model_claims.much_worse_on_stones,
    ),
    _Statement(
        "IV-C, Fig. 8",
        "The GP's variance is much higher on stones than on plates.",
        "stones and plates",
        model_claims.larger_variance,
    ),
    _Statement(
        "IV-C",
        "The GP takes the noise of the stones into its variance.",
        "two trials on stones",
        model_claims.band_coverage,
    ),
    _Statement(
        "IV-D",
        "The error on plates is about that of the force sensor, 0.4 N.",
        "plates",
        model_claims.plate_error,
    ),
    _Statement(
        "IV-D, Fig. 10",
        "Models of stones are not specific: similar errors on other stones.",
        "two terrains of stones",
        model_claims.unspecific_stones,
    ),
    _Statement(
        "IV-D, Fig. 10",
        "The inclination hardly matters.",
        "two inclines of the same stones",
        model_claims.inclination,
    ),
    _Statement(
        "IV-D, Fig. 10",
        "In general plate models are significantly worse on stones, and vice versa.",
        "stones and plates",
        model_claims.unlike_surfaces,
    ),
    _Statement(
        "IV-D",
        "Flat and rocky ground can be distinguished by the smallest error.",
        "stones and plates",
        model_claims.flat_or_rocky,
    ),
    _Statement(
        "IV-D",
        "v_t and F_n do not fully capture the friction on stones.",
        "stones and plates",
        model_claims.unexplained,
    ),
    _Statement(
        "V",
        "Input-dependent noise may help on stones.",
        "stones, and the model with chosen noise",
        model_claims.noise_by_input,
    ),
)
