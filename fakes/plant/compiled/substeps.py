# pyright: basic
"""Substeps of the arm on its ground: the functions that Python calls; compiled.

`bodies` and `grounds` are records as arrays of one, `rows` q, qd and qd half a step on,
shape (3, 7).
"""

import numpy as np

from fakes.ground.compiled.layout import DONE
from fakes.ground.compiled.steps import ground_step
from fakes.kernels.compiler import inline, kernel
from fakes.plant.compiled.drives import (
    DRIVES,
    begin_drives,
    follow,
    friction_torque,
    resist,
    take_sent,
)
from fakes.plant.compiled.motion import LINKS, accelerate, linearise, take_rates

BODY = np.dtype(
    [
        *LINKS,
        *DRIVES,
        ("is_held", np.int64),
        # Force on the hand with the weight that the person carries, stiffness and
        # damping of the grip [N m/rad, N m s/rad].
        ("hand_load", float, (5,)),
        ("left", np.int64),  # substeps
    ],
    align=True,
)


@kernel
def begin_cycle(bodies, rows):
    """Take positions, Jacobians and rates anew."""
    linearise(bodies[0], rows)


@kernel
def go_on(bodies, grounds, rows, steps):
    """Go on by `steps`, or by what is left of them (0).

    Return what a ground's step waits for.
    """
    b, g = bodies[0], grounds[0]
    if steps:
        b.left = steps
    if b.is_driven:
        take_sent(b)
    if b.is_fresh:
        begin_drives(b, rows)
    while b.left > 0:
        event = ground_step(g, b.dt, b.motion)
        if event != DONE:
            return event
        w = g.contact
        for k in range(6):
            b.sum[k] += -w[k] if k == 0 else w[k]
        if not b.is_held:
            _integrate(b, w, rows)
        b.left -= 1
    return DONE


@inline
def _integrate(b, contact, rows):
    resist(b, rows)
    _take_torques(b, contact)
    accelerate(b, rows[0], rows[2])
    dt = b.dt
    for i in range(7):
        q, qd, qdd = rows[0, i], rows[1, i], b.qdd[i]
        rows[0, i] = q + dt * qd + dt * dt * qdd
        rows[1, i] = qd + dt * qdd
        rows[2, i] = qd + 1.5 * dt * qdd
    take_rates(b, rows[1])
    follow(b)
    for k in range(3):
        b.motion[k] += dt * b.motion[3 + k]
        b.tilt[k] -= dt * b.hand_rates[3 + k]


@inline
def _take_torques(b, contact):
    """Turn the wrenches on foot and hand and the friction into torques."""
    stiffness, damping = b.hand_load[3], b.hand_load[4]
    for j in range(7):
        b.torques[j] = b.driving[j]
    for k in range(6):
        force = -contact[k] if k == 0 else contact[k]
        on_hand = b.hand_load[k % 3]
        if k >= 3:
            on_hand = stiffness * b.tilt[k - 3] - damping * b.hand_rates[k]
        for j in range(7):
            b.torques[j] += b.A[k, j] * force + b.A[6 + k, j] * on_hand
    for i in range(7):
        against = friction_torque(b, i)
        for j in range(7):
            b.torques[j] += b.j2mp[i, j] * against
