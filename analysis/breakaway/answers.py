"""What a break-away model answers, and which questions it takes."""

import math
from dataclasses import dataclass

from acquisition.errors import SettingsError


@dataclass(frozen=True, slots=True)
class BreakAwayRisk:
    """The probability that a push slips before it reaches the force that it needs.

    Attributes:
        risk: 0 to 1.
        low: lower end of the 90 % interval, from resampled trials.
        high: its upper end.
        kind: "break-away", or "sliding" where too few pushes slipped.
        v_slip: velocity that made a slip [m/s].
        slips: pushes that slipped, of those the model was fitted to.
        held: pushes that held.
        is_extrapolated: F_n or the force lies outside 2 to 98 % of the pushes.
    """

    risk: float
    low: float
    high: float
    kind: str
    v_slip: float
    slips: int
    held: int
    is_extrapolated: bool

    def of_steps(self, count: int) -> float:
        """Return the probability of at least one slip in `count` such pushes."""
        if self.risk >= 1.0:
            return 1.0 if count > 0 else 0.0
        return -math.expm1(count * math.log1p(-self.risk))


@dataclass(frozen=True, slots=True)
class AvailableForce:
    """The force that may be asked for at a risk.

    Attributes:
        force: F_t [N].
        low: lower end of the 90 % interval [N], from resampled trials.
        high: its upper end [N].
        kind: "break-away" or "sliding".
        v_slip: velocity that made a slip [m/s].
        slips: pushes that slipped, of those the model was fitted to.
        held: pushes that held.
        is_extrapolated: F_n or the force lies outside 2 to 98 % of the pushes.
    """

    force: float
    low: float
    high: float
    kind: str
    v_slip: float
    slips: int
    held: int
    is_extrapolated: bool


def check_finite(**values: float) -> None:
    """Refuse a value that nothing can be asked for.

    Raises:
        SettingsError: one is not a finite number.
    """
    for name, value in values.items():
        try:
            is_finite = math.isfinite(value)
        except (TypeError, OverflowError):  # a word, a column, a number without end
            is_finite = False
        if not is_finite:
            raise SettingsError(f"{name} = {value!r:.40} is not a finite number.")


def check_query(**forces: float) -> None:
    """Refuse forces that no push can have.

    Raises:
        SettingsError: a value is negative or no finite number.
    """
    check_finite(**forces)
    for name, force in forces.items():
        if force < 0.0:
            raise SettingsError(
                f"{name} = {force:g} N is negative.", hint="Give a force of 0 or more."
            )


def check_share(risk: float) -> None:
    """Refuse a risk at which no force is available.

    Raises:
        SettingsError: it is not between 0 and 1.
    """
    if not 0.0 < risk < 1.0:
        raise SettingsError(
            f"risk = {risk} is not between 0 and 1.", hint="Give e.g. 0.1."
        )
