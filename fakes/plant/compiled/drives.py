# pyright: basic
"""Stops of the joints and bristles of the motors over a record; compiled.

Number by number what `fakes.plant.joints` and `fakes.plant.friction` do, except that
matrices are summed in another order.

`b` is the record of the arm, of which `DRIVES` is a part.
"""

import math

import numpy as np

from fakes.kernels.compiler import inline
from fakes.plant.friction import bristle_columns, lively_speeds, plastic_share
from fakes.plant.joints import NEAR, STOP_B, STOP_K
from wam.model.arm_model import drive_inertia_matrix
from wam.model.constants import ArmConstants, Array
from wam.model.friction import ELASTIC, MotorFriction

_FIXED = [
    ("dt", float),
    ("drive_inertia", float, (7,)),
    ("j2mp", float, (7, 7)),
    ("ipnm", float, (7,)),
    ("units", float, (7,)),  # that were sent
    ("lower", float, (7,)),
    ("upper", float, (7,)),
    ("coulomb", float, (7,)),  # at no load
    ("load", float, (7,)),
    ("asymmetry", float, (7,)),
    ("ripple_sin", float, (7,)),
    ("ripple_cos", float, (7,)),
    ("more", float, (7,)),  # s - 1
    ("slow", float, (7,)),  # 1 / w_s
    ("s0", float, (7,)),
    ("of_bent", float, (7,)),  # s0 dt + s1
    ("of_still", float, (7,)),  # s0 + s1 / dt
    ("s1_dt", float, (7,)),
    ("viscous", float, (7,)),
    ("lively", float, (7,)),  # speed from which a bristle is taken anew sooner
]
_OF_A_CYCLE = [
    ("is_bearing", np.int64),  # load and ripple of the friction are to be taken anew
    ("is_fresh", np.int64),  # so are the drives
    ("is_driven", np.int64),  # so are the torques that were sent
    ("is_near", np.int64),  # to a stop
    ("is_lively", np.int64),
    ("ways", float, (7, 2)),  # dry friction forward and backward
    ("sent", float, (7,)),  # torques of the motors
    ("tau", float, (7,)),  # the same at the joints
    ("disturbance", float, (7,)),
    ("disturbed", float, (7,)),  # the disturbance when torques were sent last
]
_OF_A_SUBSTEP = [
    ("speeds", float, (7,)),  # of the motors
    ("z", float, (7,)),
    ("keep", float, (7,)),
    ("damping", float, (7,)),
    ("springs", float, (7,)),
    ("stop_torques", float, (7,)),
    ("stop_damping", float, (7,)),
    ("driving", float, (7,)),
    ("armature", float, (7,)),
]
DRIVES = [*_FIXED, *_OF_A_CYCLE, *_OF_A_SUBSTEP]
_COLUMNS = ("more", "slow", "s0", "of_bent", "of_still", "s1_dt", "viscous")
_plastic_share = inline(plastic_share)


def take_drives(
    record: np.void,
    constants: ArmConstants,
    friction: MotorFriction,
    inertia: Array,
    dt: float,
) -> None:
    """Take friction, transmission and stops."""
    record["dt"] = dt
    record["drive_inertia"] = np.diag(drive_inertia_matrix(constants))
    record["j2mp"], record["ipnm"] = constants.j2mp, constants.ipnm
    record["lower"], record["upper"] = constants.q_lower, constants.q_upper
    record["coulomb"] = friction.coulomb - friction.load * friction.load_at
    for name in ("load", "asymmetry", "ripple_sin", "ripple_cos"):
        record[name] = getattr(friction, name)
    columns = np.array(bristle_columns(friction, inertia, dt))
    for name, column in zip(_COLUMNS, columns.T, strict=True):
        record[name] = column
    record["lively"] = lively_speeds(friction)


@inline
def begin_drives(b, rows):
    """Take anew what stays as it is for 2 ms."""
    _stop(b, rows)
    if b.is_bearing:
        _bear(b, rows[0])
    b.is_lively = 0
    for i in range(7):
        if not -b.lively[i] <= b.speeds[i] <= b.lively[i]:
            b.is_lively = 1
    _resist(b)
    b.is_fresh = 0


@inline
def take_sent(b):
    """Let the torques that were sent drive the joints."""
    for i in range(7):
        b.sent[i] = b.units[i] / b.ipnm[i]
    for j in range(7):
        total = 0.0
        for i in range(7):
            total += b.j2mp[i, j] * b.sent[i]
        b.tau[j] = total
    _add_up(b, b.disturbed)
    b.is_driven = 0


@inline
def resist(b, rows):
    """Take the resistance anew near a stop and where a motor is fast."""
    if b.is_near:
        _stop(b, rows)
        _resist(b)
    elif b.is_lively:
        _resist(b)


@inline
def friction_torque(b, i):
    """Return the torque of friction on motor `i` [N m]."""
    return -b.springs[i] * b.z[i] - b.damping[i] * b.speeds[i]


@inline
def follow(b):
    """Bend the bristles by a step at the speeds of the motors."""
    for i in range(7):
        b.z[i] = b.keep[i] * (b.z[i] + b.dt * b.speeds[i])


@inline
def _add_up(b, disturbance):
    """Add up what drives the joints."""
    for i in range(7):
        b.driving[i] = b.tau[i] + disturbance[i]
        if b.is_near:
            b.driving[i] += b.stop_torques[i]


@inline
def _stop(b, rows):
    b.is_near = 0
    for i in range(7):
        b.stop_torques[i] = b.stop_damping[i] = 0.0
        if not b.lower[i] + NEAR <= rows[0, i] <= b.upper[i] - NEAR:
            b.is_near = 1
    if b.is_near:
        for i in range(7):
            angle = rows[0, i]
            beyond = max(angle - b.upper[i], 0.0) - max(b.lower[i] - angle, 0.0)
            if beyond != 0.0:
                b.stop_damping[i] = STOP_B
                b.stop_torques[i] = -STOP_K * beyond - STOP_B * rows[1, i]
    _add_up(b, b.disturbance)


@inline
def _bear(b, q):
    """Take the dry friction where the motors are, under what they bear."""
    for i in range(7):
        angle = 0.0
        for j in range(7):
            angle += b.j2mp[i, j] * q[j]
        torque = b.sent[i] + friction_torque(b, i)
        level = b.coulomb[i] + b.load[i] * abs(torque)
        ripple = (
            1.0 + b.ripple_sin[i] * math.sin(angle) + b.ripple_cos[i] * math.cos(angle)
        )
        b.ways[i, 0] = (level + b.asymmetry[i]) * ripple
        b.ways[i, 1] = (level - b.asymmetry[i]) * ripple


@inline
def _resist(b):
    _take_bristles(b)
    for j in range(7):
        total = 0.0
        for i in range(7):
            total += b.j2mp[i, j] * b.j2mp[i, j] * b.damping[i]
        if b.is_near:
            total += b.stop_damping[j]
        b.armature[j] = total * b.dt + b.drive_inertia[j]


@inline
def _take_bristles(b):
    """Take c, D and a of the bristles anew at the speeds of the motors."""
    dt = b.dt
    for i in range(7):
        w, z, s0 = b.speeds[i], b.z[i], b.s0[i]
        b.keep[i] = 1.0
        b.damping[i] = b.of_bent[i] + b.viscous[i]
        b.springs[i] = s0
        if z * w <= 0.0:
            continue
        x = w * b.slow[i]
        is_forward = w > 0.0
        speed, bend = (w, z) if is_forward else (-w, -z)
        g = b.ways[i, 0] if is_forward else b.ways[i, 1]
        g *= 1.0 + b.more[i] / (1.0 + x * x)
        bent = bend * s0 / g
        if bent > ELASTIC:
            rate = _plastic_share(bent) * s0 * speed / g
            keep = 1.0 / (1.0 + dt * rate)
            b.keep[i] = keep
            b.damping[i] = keep * b.of_bent[i] + b.viscous[i]
            b.springs[i] = keep * b.of_still[i] - b.s1_dt[i]
