"""Quantities for the paper's statements about models: errors, bands, parameters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.quality import SENSOR_ERROR
from analysis.report.sections.beyond_paper.residuals import (
    explained_share,
    held_out_residual,
)
from analysis.report.sections.paper.evidence import PaperEvidence
from analysis.report.sections.paper.quantities import (
    ClaimResult,
    beyond_chance,
    count_significant,
    ends_of,
)
from analysis.study.fits import tustin_medians
from analysis.study.metrics import PairedComparison, compare, standard_error
from analysis.study.models import GP_NN, GP_SE, PAPER_MODELS, TUSTIN
from analysis.study.terrain_fit import TerrainResult, mean_of
from analysis.terrains.identify import KEPT_PER_SECOND
from analysis.tustin.model import NO_STRIBECK, NOT_IDENTIFIABLE

_BAND, _BAND_SLACK = 0.95, 0.05  # nominal coverage and its tolerance


@dataclass(frozen=True, slots=True)
class ForeignError:
    """The GP of one terrain tested on another.

    Attributes:
        ratio: error over that of the tested terrain's own GP.
        paired: error minus that of the own GP [N], fold by fold.
        is_same_kind: both terrains have the same stones, or both are plates.
    """

    ratio: float
    paired: PairedComparison
    is_same_kind: bool


def gain_of_more_rows(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the effect of more training rows."""
    entries = evidence.more_rows
    if not entries:
        return None
    gains = [entry.gain for entry in entries]
    better = count_significant([entry.paired for entry in entries], -1)
    points = evidence.study.options.fit.gp_points
    text = (
        f"With {max(entry.rows for entry in entries)} rows instead of {points} "
        "(fixed hyperparameters) the error of GP (SE) changes by "
        f"{ends_of([-gain for gain in gains], '+.1%')}; smaller beyond chance on "
        f"{beyond_chance([entry.paired for entry in entries], -1, 'terrains')}."
    )
    return ClaimResult(text, {"largest gain": max(gains), "better": better})


def signs_of_b(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the sign of the viscous coefficient on stones and on plates."""
    b = [
        [v for r in results if (v := tustin_medians(r)["b"]) is not None]
        for results in (evidence.stones, evidence.plates)
    ]
    if not all(b):
        return None
    falling, rising = sum(v < 0 for v in b[0]), sum(v > 0 for v in b[1])
    text = (
        f"b is {ends_of(b[0], '.3g')} kg/s on stones, negative on {falling} of "
        f"{len(b[0])} terrains; {ends_of(b[1], '.3g')} kg/s on plates, positive on "
        f"{rising} of {len(b[1])}."
    )
    share = (falling + rising) / (len(b[0]) + len(b[1]))
    numbers = {"largest b, stones": max(b[0]), "smallest b, plates": min(b[1])}
    return ClaimResult(text, numbers, {"share of terrains": share})


def shapeless_stones(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the share of Tustin fits on stones without Stribeck shape."""
    folds = [f for r in evidence.stones for f in r.models(TUSTIN)]
    if not folds:
        return None
    doubtful = {NO_STRIBECK, NOT_IDENTIFIABLE}
    count = sum(bool(doubtful & set(fold.model.flags)) for fold in folds)
    text = (
        f"{count} of {len(folds)} fits on stones (one per fold) are flagged "
        f"“{NO_STRIBECK}” or “{NOT_IDENTIFIABLE}”."
    )
    share = count / len(folds)
    return ClaimResult(text, {"share": share})


def spread_on_stones(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the difference between the five models on stones."""
    return _spread(evidence.stones)


def spread_on_plates(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the difference between the five models on plates."""
    return _spread(evidence.plates)


def _spread(results: Sequence[TerrainResult]) -> ClaimResult | None:
    gap = largest_gap(results)
    pairs = [compare(r.maes(TUSTIN), r.maes(GP_SE)) for r in results]
    present = [pair for pair in pairs if pair is not None]
    if gap is None or not present:
        return None
    mean = mean_of([pair.difference for pair in present]) or 0.0
    text = (
        f"Worst over best of the five: at most {gap:+.0%} on a terrain. GP (SE) minus "
        f"Tustin {mean:+z.3f} N on average; GP better beyond chance on "
        f"{beyond_chance(present, -1, 'terrains')}, Tustin on "
        f"{count_significant(present, 1)}."
    )
    return ClaimResult(text, {"gap": gap, "GP - Tustin [N]": mean})


def kernels_on_stones(evidence: PaperEvidence) -> ClaimResult | None:
    """Compare the errors of the NN and the SE kernel on stones."""
    pairs = [compare(r.maes(GP_SE), r.maes(GP_NN)) for r in evidence.stones]
    present = [pair for pair in pairs if pair is not None]
    if not present:
        return None
    better, mean = (
        count_significant(present, -1),
        mean_of([p.difference for p in present]),
    )
    text = (
        f"NN minus SE {mean:+z.3f} N on average over the stones; NN better beyond "
        f"chance on {beyond_chance(present, -1, 'terrains')}."
    )
    return ClaimResult(text, {"NN - SE [N]": mean or 0.0}, {"better": better})


def largest_gap(results: Sequence[TerrainResult]) -> float | None:
    """Return the largest relative gap between worst and best of the five models."""
    gaps = [
        max(errors) / min(errors) - 1.0
        for result in results
        if len(errors := [e for m in PAPER_MODELS if (e := result.mae(m))]) > 1
    ]
    return max(gaps) if gaps else None


def foreign_error(source: TerrainResult, tested: TerrainResult) -> ForeignError | None:
    """Compare the GP of `source` with the own GP on `tested`; None if not tested."""
    foreign = [e for fold in source.models(GP_SE) for e in fold.cross[tested.terrain]]
    own = [fold.score.mae for fold in tested.models(GP_SE)]
    count = min(len(foreign), len(own))
    paired = compare(own[:count], foreign[:count])
    if paired is None or not sum(own):
        return None
    ratio = float(np.mean(foreign) / np.mean(own))
    return ForeignError(ratio, paired, source.kind == tested.kind)


def error_ratio(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the ratio of the GP's error on stones to that on plates."""
    return _stones_over_plates(evidence, "mae", "N")


def variance_ratio(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the ratio of the GP's predictive variance on stones to that on plates."""
    return _stones_over_plates(evidence, "variance", "N²")


def _stones_over_plates(
    evidence: PaperEvidence, key: str, unit: str
) -> ClaimResult | None:
    stones, plates = (
        [v for r in group if (v := mean_of(r.scores(GP_SE, key))) is not None]
        for group in (evidence.stones, evidence.plates)
    )
    if not stones or not plates:
        return None
    ratio = min(stones) / max(plates)
    text = (
        f"GP (SE): {ends_of(stones, '.2g')} {unit} on stones, {ends_of(plates, '.2g')} "
        f"{unit} on plates; the smallest on stones is {ratio:.1f} times the largest on "
        "plates."
    )
    return ClaimResult(text, {"ratio": ratio})


def band_coverage(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the coverage of the GP's 95 % band on stones."""
    shares = [s for r in evidence.stones for s in r.scores(GP_SE, "coverage95")]
    mean, error = mean_of(shares), standard_error(shares)
    if mean is None or error is None:
        return None
    text = (
        f"The 95% band of GP (SE) holds {mean:.1%} ± {error:.1%} of the samples of "
        "held-out trials on stones."
    )
    off = abs(mean - _BAND) - max(2.0 * error, _BAND_SLACK)
    numbers = {"coverage": mean, "error": error}
    return ClaimResult(text, numbers, {"deviation beyond tolerance": off})


def plate_error(evidence: PaperEvidence) -> ClaimResult | None:
    """Compare the mean error on plates with that of the sensor."""
    pairs = [(r.mae(TUSTIN), r.mae(GP_SE)) for r in evidence.plates]
    mean = mean_of([error for pair in pairs for error in pair])
    if mean is None:
        return None
    text = (
        f"{mean:.2f} N, mean over Tustin and GP (SE) on {len(pairs)} plates; the "
        f"paper's sensor has about {SENSOR_ERROR:g} N."
    )
    return ClaimResult(text, {"error [N]": mean})


def foreign_stones(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the error ratios of stone models on other stones to the own models."""
    return _foreign_ratios(_foreign(evidence.stones, evidence.stones), "stone models")


def other_inclines(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the error ratios between inclines of the same stones."""
    pairs = _foreign(evidence.stones, evidence.stones)
    same = [pair for pair in pairs if pair.is_same_kind]
    return _foreign_ratios(same, "models of the same stones at another incline")


def foreign_surfaces(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the error ratios of plate models on stones and the reverse."""
    forth = _foreign(evidence.plates, evidence.stones)
    back = _foreign(evidence.stones, evidence.plates)
    if not forth or not back:
        return None
    every = [pair.paired for pair in (*forth, *back)]
    worse, count = count_significant(every, 1), len(every)
    ratios = [[pair.ratio for pair in pairs] for pairs in (forth, back)]
    text = (
        "Error over the own model's: plate models on stones "
        f"{ends_of(ratios[0], '.1f')}, stone models on plates "
        f"{ends_of(ratios[1], '.1f')}; worse beyond chance in "
        f"{beyond_chance(every, 1, 'pairs of terrains')}."
    )
    ends = {
        "share of pairs": worse / count,
        "smallest ratio": min(ratios[0] + ratios[1]),
    }
    return ClaimResult(text, {"worse": worse, "pairs": count}, ends)


def flat_or_rocky(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the accuracy of the smallest-error rule for plates and stones."""
    identification = evidence.identification
    if identification is None or not (evidence.stones and evidence.plates):
        return None
    shares = {
        size / KEPT_PER_SECOND: identification.by_error[size]["surface"].accuracy
        for size in identification.sizes
    }
    if not shares:
        return None
    parts = [f"{share:.0%} of windows of {s:g} s" for s, share in shares.items()]
    text = f"By the smallest error, {', '.join(parts)} are classified correctly."
    numbers = {f"{seconds:g} s": share for seconds, share in shares.items()}
    return ClaimResult(text, numbers, {"best share": max(shares.values())})


def unexplained(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the variance of F_t not explained by F_n and v_t on stones and plates."""
    residual_sds = [
        [float(held_out_residual(r, GP_SE).std()) for r in group if r.models(GP_SE)]
        for group in (evidence.stones, evidence.plates)
    ]
    shares = [
        s for r in evidence.stones if (s := explained_share(r, GP_SE)) is not None
    ]
    if not all(residual_sds) or not shares:
        return None
    text = (
        f"F_n and v_t explain {ends_of(shares, '.0%')} of the variance of F_t on "
        f"stones; unexplained are {ends_of(residual_sds[0], '.2f')} N there, "
        f"{ends_of(residual_sds[1], '.2f')} N on plates (standard deviations)."
    )
    on_plates = max(residual_sds[1])
    ratio = min(residual_sds[0]) / on_plates if on_plates else math.inf
    return ClaimResult(text, {"R²": max(shares)}, {"stones over plates": ratio})


def gain_of_chosen_noise(evidence: PaperEvidence) -> ClaimResult | None:
    """Return the gain from input-dependent noise on stones."""
    names = {result.terrain for result in evidence.stones}
    pairs = [s.paired for s in evidence.noise if s.terrain in names]
    if not pairs:
        return None
    better, gains = count_significant(pairs, -1), [-pair.difference for pair in pairs]
    text = (
        "Noise chosen among constant and input-dependent gains "
        f"{ends_of(gains, '+.3f')} in log density; beyond chance on "
        f"{beyond_chance(pairs, -1, 'terrains of stones')}."
    )
    numbers = {"largest gain": max(gains), "better": better}
    return ClaimResult(text, numbers, {"smallest gain": min(gains)})


def _foreign(
    sources: Sequence[TerrainResult], tested: Sequence[TerrainResult]
) -> list[ForeignError]:
    pairs = [foreign_error(a, b) for a in sources for b in tested if a is not b]
    return [pair for pair in pairs if pair is not None]


def _foreign_ratios(pairs: Sequence[ForeignError], which: str) -> ClaimResult | None:
    if not pairs:
        return None
    ratios = [pair.ratio for pair in pairs]
    mean = float(np.mean(ratios))
    text = (
        f"Error of {which} over the own model's: {mean:.2f} on average "
        f"({ends_of(ratios, '.2f')}), larger beyond chance in "
        f"{beyond_chance([pair.paired for pair in pairs], 1, 'pairs of terrains')}."
    )
    numbers = {"mean": mean, "largest": max(ratios)}
    return ClaimResult(text, numbers, {"smallest": min(ratios)})
