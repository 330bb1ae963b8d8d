"""Testable statements of the paper as data, and their evaluation on a study.

A row has the statement, its quantities, and the bounds on them within which a study
agrees or partly agrees. Statements about terrains that a study lacks are not evaluated.
"""

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from analysis.data.quality import SENSOR_ERROR
from analysis.report.results import StudyResults
from analysis.report.sections.beyond_paper.noise import noise_summaries
from analysis.report.sections.paper import model_quantities as models
from analysis.report.sections.paper import trial_quantities as trials
from analysis.report.sections.paper.evidence import PaperEvidence, gather_evidence
from analysis.report.sections.paper.quantities import ClaimResult


class Agreement(Enum):
    """Whether a study agrees with a statement."""

    YES = "yes"
    PARTLY = "partly"
    NO = "no"
    OPEN = "not shown"


@dataclass(frozen=True, slots=True)
class Bound:
    """A bound on a quantity.

    Attributes:
        quantity: name of the measured quantity.
        relation: required relation of the quantity to the limit.
        limit: limit in the unit of the quantity.
    """

    quantity: str
    relation: Callable[[float, float], bool]
    limit: float

    def holds(self, quantities: Mapping[str, float]) -> bool:
        """Return whether the quantity is within the bound."""
        return self.relation(quantities[self.quantity], self.limit)


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the paper and the criteria for agreement.

    Attributes:
        reference: section, figure or equation of the paper.
        statement: text of the statement.
        needs: data that a study needs to test it.
        measure: function that returns its quantities; None if the study lacks them.
        agrees: bounds that must all hold for agreement.
        partly: bounds that must all hold for partial agreement; none = not possible.
    """

    reference: str
    statement: str
    needs: str
    measure: Callable[[PaperEvidence], ClaimResult | None]
    agrees: Sequence[Bound]
    partly: Sequence[Bound] = ()

    def verdict(self, quantities: Mapping[str, float]) -> Agreement:
        """Judge the agreement of a study with these quantities."""
        if all(bound.holds(quantities) for bound in self.agrees):
            return Agreement.YES
        if self.partly and all(bound.holds(quantities) for bound in self.partly):
            return Agreement.PARTLY
        return Agreement.NO


@dataclass(frozen=True, slots=True)
class PaperClaim:
    """One statement of the paper with the result of the study.

    Attributes:
        reference: section, figure or equation of the paper.
        statement: text of the statement.
        shown: result of this study, or missing data.
        agreement: whether the two agree.
        numbers: numbers of `shown` in SI units, shares as 1.
    """

    reference: str
    statement: str
    shown: str
    agreement: Agreement
    numbers: Mapping[str, float]

    def plain(self) -> dict[str, Any]:
        """Return the statement as plain values for fits.json."""
        return {
            "place": self.reference,
            "statement": self.statement,
            "shown": self.shown,
            "agrees": self.agreement.value,
            "numbers": dict(self.numbers),
        }


def study_claims(results: StudyResults) -> list[PaperClaim]:
    """Evaluate the paper's statements on a study; see `paper_claims`."""
    noise = results.of(noise_summaries)
    return paper_claims(gather_evidence(results.study, results.identification, noise))


def paper_claims(evidence: PaperEvidence) -> list[PaperClaim]:
    """Evaluate every statement.

    Empty for a single terrain, which allows no comparison, or for terrains that are not
    the paper's.
    """
    terrains = evidence.study.terrains.values()
    if len(terrains) < 2 or not all(terrain.is_paper_terrain for terrain in terrains):
        return []
    return [evaluate(claim, evidence) for claim in CLAIMS]


def evaluate(claim: Claim, evidence: PaperEvidence) -> PaperClaim:
    """Evaluate a statement on a study."""
    measured = claim.measure(evidence)
    if measured is None:
        missing = f"Not testable in this study: it needs {claim.needs}."
        return PaperClaim(claim.reference, claim.statement, missing, Agreement.OPEN, {})
    return PaperClaim(
        claim.reference,
        claim.statement,
        measured.text,
        claim.verdict({**measured.numbers, **measured.further}),
        measured.numbers,
    )


def _above(quantity: str, limit: float) -> Bound:
    return Bound(quantity, operator.gt, limit)


def _below(quantity: str, limit: float) -> Bound:
    return Bound(quantity, operator.lt, limit)


def _at_least(quantity: str, limit: float) -> Bound:
    return Bound(quantity, operator.ge, limit)


def _at_most(quantity: str, limit: float) -> Bound:
    return Bound(quantity, operator.le, limit)


_SIMILAR = 0.15  # largest relative difference of similar errors
_MUCH = 2.0  # smallest ratio that counts as much higher

CLAIMS: Sequence[Claim] = (
    Claim(
        "eq. 2",
        "While the foot sticks, |F_t| ≤ μ F_n.",
        "stones or plates that stick",
        trials.sticking,
        agrees=[_at_least("smallest share", 0.95)],
        partly=[_at_least("largest share", 0.95)],
    ),
    Claim(
        "IV, Fig. 4",
        "In a slip the traction force drops to near zero.",
        "slips on stones",
        trials.floor,
        agrees=[_below("median floor", 0.25)],
        partly=[_above("below 30%", 0.5)],
    ),
    Claim(
        "IV, Fig. 4",
        "The foot bounces back after slips (two of the three printed).",
        "slips on stones",
        trials.bounce,
        agrees=[_above("share", 1 / 3)],
        partly=[_above("share", 0.0)],
    ),
    Claim(
        "IV, Fig. 4",
        "Bounce-back comes with an opposing spike of the force.",
        "bounce-backs on stones",
        trials.spike,
        agrees=[_above("median spike", 0.2)],
    ),
    Claim(
        "IV, Fig. 4",
        "F_t decreases before a slip (two of the three printed).",
        "slips on stones",
        trials.sag,
        agrees=[_above("share", 0.5)],
        partly=[_above("share", 0.08)],
    ),
    Claim(
        "IV",
        "The window of velocities holds the majority of the data.",
        "stones or plates",
        trials.window,
        agrees=[_above("all", 0.5)],
        partly=[_above("moving", 0.5)],
    ),
    Claim(
        "Table I",
        "The viscous coefficient b is negative on stones, positive on plates.",
        "stones and plates",
        models.signs_of_b,
        agrees=[_at_least("share of terrains", 1.0)],
        partly=[_above("share of terrains", 0.0)],
    ),
    Claim(
        "Table I",
        "On stones δ_s is near zero: a straight line, no Stribeck shape.",
        "stones",
        models.shapeless_stones,
        agrees=[_above("share", 0.5)],
        partly=[_above("share", 0.0)],
    ),
    Claim(
        "IV-B",
        "More than 300 training points do not increase the accuracy.",
        "trials with more rows than a process is fitted to",
        models.gain_of_more_rows,
        agrees=[_below("largest gain", 0.05)],
        partly=[_at_most("better", 0)],
    ),
    Claim(
        "II-B",
        "The NN covariance adapts better to non-smooth data.",
        "stones",
        models.kernels_on_stones,
        agrees=[_above("better", 0)],
    ),
    Claim(
        "IV-C, Fig. 9",
        "The models perform similarly on stones.",
        "stones",
        models.spread_on_stones,
        agrees=[_below("gap", _SIMILAR)],
    ),
    Claim(
        "IV-C, Fig. 9",
        "The models perform similarly on plates.",
        "plates",
        models.spread_on_plates,
        agrees=[_below("gap", _SIMILAR)],
    ),
    Claim(
        "IV-C, Fig. 9",
        "The error is much higher on stones than on plates.",
        "stones and plates",
        models.error_ratio,
        agrees=[_above("ratio", _MUCH)],
        partly=[_above("ratio", 1.0)],
    ),
    Claim(
        "IV-C, Fig. 8",
        "The GP's variance is much higher on stones than on plates.",
        "stones and plates",
        models.variance_ratio,
        agrees=[_above("ratio", _MUCH)],
        partly=[_above("ratio", 1.0)],
    ),
    Claim(
        "IV-C",
        "The GP takes the noise of the stones into its variance.",
        "two trials on stones",
        models.band_coverage,
        agrees=[_below("deviation beyond tolerance", 0.0)],
    ),
    Claim(
        "IV-D",
        "The error on plates is about that of the force sensor, 0.4 N.",
        "plates",
        models.plate_error,
        agrees=[
            _at_least("error [N]", 0.5 * SENSOR_ERROR),
            _at_most("error [N]", 1.5 * SENSOR_ERROR),
        ],
    ),
    Claim(
        "IV-D, Fig. 10",
        "Models of stones are not specific: similar errors on other stones.",
        "two terrains of stones",
        models.foreign_stones,
        agrees=[_below("mean", 1.0 + _SIMILAR)],
        partly=[_below("smallest", 1.0 + _SIMILAR)],
    ),
    Claim(
        "IV-D, Fig. 10",
        "The inclination hardly matters.",
        "two inclines of the same stones",
        models.other_inclines,
        agrees=[_below("mean", 1.0 + _SIMILAR)],
        partly=[_below("smallest", 1.0 + _SIMILAR)],
    ),
    Claim(
        "IV-D, Fig. 10",
        "In general plate models are significantly worse on stones, and vice versa.",
        "stones and plates",
        models.foreign_surfaces,
        agrees=[_at_least("share of pairs", 0.8)],
        partly=[_above("smallest ratio", 1.0)],
    ),
    Claim(
        "IV-D",
        "Flat and rocky ground can be distinguished by the smallest error.",
        "stones and plates",
        models.flat_or_rocky,
        agrees=[_above("best share", 0.8)],
        partly=[_above("best share", 0.6)],
    ),
    Claim(
        "IV-D",
        "v_t and F_n do not fully capture the friction on stones.",
        "stones and plates",
        models.unexplained,
        agrees=[_below("R²", 0.8), _above("stones over plates", _MUCH)],
        partly=[_below("R²", 0.8)],
    ),
    Claim(
        "V",
        "Input-dependent noise may help on stones.",
        "stones, and the model with chosen noise",
        models.gain_of_chosen_noise,
        agrees=[_above("better", 0)],
        partly=[_above("smallest gain", 0.0)],
    ),
)
