"""Parameters of stone beds by grain size, and the effect of a slope."""

import math
from dataclasses import dataclass, fields

from acquisition.errors import SettingsError

_REPOSE = math.radians(40.0)  # angle of repose of dumped crushed stone


@dataclass(frozen=True, slots=True)
class StoneParameters:
    """A bed of one stone size.

    Attributes:
        d50: grain size [m].
        N: number of contacts that share the load.
        J0: mean capacity of a jam [N].
        k_J: shape of its Gamma distribution.
        k_n: normal stiffness of the bed [N/m].
        run: mean free run to the next jam [d50].
        k_run: shape of its Gamma distribution.
        disp: spread of the contacts' engagement positions [d50].
        gap: mean gap until a broken contact engages again [d50].
        s_inf: final slip sinkage [d50].
        k_w: shape of the Gamma distribution of load sharing.
        sigma_k: standard deviation of the log contact stiffness.
        cop: spread of the centre of pressure [m rms].
        K_t: tangential stiffness of all contacts [N/m].
        zeta: normal damping ratio.
    """

    d50: float
    N: int
    J0: float
    k_J: float
    k_n: float
    run: float
    k_run: float
    disp: float
    gap: float
    s_inf: float
    k_w: float
    sigma_k: float
    cop: float
    K_t: float = 2200.0
    zeta: float = 0.35


STONES = {
    "small": StoneParameters(
        0.019, 7, 12.0, 6.0, 2500.0, 0.60, 2.0, 0.05, 0.10, 0.12, 2.5, 0.35, 0.010
    ),
    "big": StoneParameters(
        0.037, 4, 12.5, 4.5, 3000.0, 0.50, 1.6, 0.04, 0.08, 0.10, 2.0, 0.45, 0.015
    ),
}


_FINEST, _COARSEST = 0.010, 0.060  # range of simulated d50 [m]
_FEWEST = 2  # contacts


def stones_of_size(d50: float) -> StoneParameters:
    """Return the parameters of stones of any size between 10 and 60 mm.

    Every parameter is linear in ln d50 through the values of the two sizes.

    Args:
        d50: grain size [m].

    Raises:
        SettingsError: stones of this size are not simulated.
    """
    if not _FINEST <= d50 <= _COARSEST:
        raise not_simulated(f"stones of {1e3 * d50:g} mm")
    small, big = STONES["small"], STONES["big"]
    share = math.log(d50 / small.d50) / math.log(big.d50 / small.d50)
    values = {
        name: getattr(small, name) + share * (getattr(big, name) - getattr(small, name))
        for name in (field.name for field in fields(StoneParameters))
    }
    contacts = max(round(values.pop("N")), _FEWEST)
    return StoneParameters(**{**values, "d50": d50}, N=contacts)


def not_simulated(what: str) -> SettingsError:
    """Return the error for a ground that is not simulated."""
    return SettingsError(
        f"{what} are not simulated, only plates and stones of "
        f"{1e3 * _FINEST:g} to {1e3 * _COARSEST:g} mm.",
        hint="Record this cell on the arm, or give it another d50. Nothing was "
        "started.",
    )


def slope_factor(incline: float) -> float:
    """Return the factor eta by which a slope [rad] weakens the bed.

    Half the reduction of a free slope, because the container's walls support the bed.
    """
    loss = 0.5 * math.tan(incline) / math.tan(_REPOSE)
    return math.cos(incline) * (1.0 - loss)
