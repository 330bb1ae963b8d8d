"""The last look at a command: torques within their limits, and no sudden ones.

Every command passes here right before it is sent, whatever state or verdict it is of.
"""

from collections.abc import Sequence

import numpy as np

from acquisition.devices import Vector

# A torque changes in one cycle by this share of its limit at most: from zero to the
# limit takes 20 ms. In simulated sessions the largest change of a driven arm is 0.041
# of it (1.8 N m at joint 2, when a trial begins to float), that of the locked joint 7
# 0.018. The start of torques, a step of 26 N m at joint 2, is spread over 12 ms
# behind the brakes; the pendant cannot activate the arm so soon after. Joint 7 is
# light and its lock stiff: held back as much, the lock throws the joint that it is to
# hold (17 rad/s after a twist of 1.2 N m); at 0.3 it does not, and one false position
# makes 0.8 rad/s.
TORQUE_STEP = (0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.3)


def bounded_torque(tau: Vector, last: Vector, limits: Sequence[float]) -> Vector:
    """Return what may be sent of `tau` [N m], shape (7,); what is no number stays so.

    Args:
        tau: joint torques wanted [N m], shape (7,).
        last: joint torques as sent last [N m], shape (7,).
        limits: torque limits of the joints [N m], seven.
    """
    # Plain numbers: seven of them are bounded faster than numpy looks at an array.
    rows = zip(tau.tolist(), last.tolist(), limits, TORQUE_STEP, strict=True)
    bounded: list[float] = []
    for wanted, before, limit, share in rows:
        step = share * limit
        value = min(max(wanted, before - step), before + step)
        bounded.append(min(max(value, -limit), limit))
    return np.array(bounded)
