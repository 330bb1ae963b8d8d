"""Slip risk of a push from rest as a table over the distance from a law's centre.

The centre is b0 + b1 log(max(F_n, 1 N) / 3.5 N) in log F_t or, for a sliding model,
a + b F_n in F_t. The distribution about the centre is the same for all loads.
"""

import numpy as np

from analysis.data.series import Array
from analysis.study.slip_risk import BREAK_AWAY, BreakAwayModel

REST_POINTS = 2049
_REFERENCE_LOAD = 3.5  # N, at which the slope term of a break-away law is zero


def rest_distances(model: BreakAwayModel) -> Array:
    """Return the distances from the centre of a law at which its risk is tabulated.

    In log F_t [nat] or, for a sliding model, in F_t [N]; shape (2049,).
    """
    _, _, spread, trial_sd = model.law.values
    low, high = (14.0, 4.0) if model.kind == BREAK_AWAY else (5.5, 5.5)
    return np.linspace(
        -low * spread - 5.5 * trial_sd, high * spread + 5.5 * trial_sd, REST_POINTS
    )


def rest_risks(model: BreakAwayModel) -> Array:
    """Return the risk at `rest_distances`, from 0 to 1."""
    distances = rest_distances(model)
    if model.kind == BREAK_AWAY:
        forces = np.exp(model.law.level + distances)
        risks = model.risks(forces, np.full(forces.size, _REFERENCE_LOAD))
    else:
        risks = model.risks(model.law.level + distances, np.zeros(distances.size))
    risks[0], risks[-1] = 0.0, 1.0
    return np.maximum.accumulate(risks)
