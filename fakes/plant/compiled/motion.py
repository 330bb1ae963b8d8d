# pyright: basic
"""The links: where they are, how sole and hand move with them, how they accelerate.

Articulated-body algorithm in the terrain frame. Spatial vectors are (turn, velocity of
the point at the origin) and (moment about the origin, force), so that nothing is
transformed from link to link.

R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008, chapter 7.

`b` is the record of the arm, of which `LINKS` is a part.
"""

import math

import numpy as np

from fakes.kernels.compiler import inline
from fakes.plant.model import ArmAndHand

_FIXED = [
    ("turn", float, (7, 3, 3)),  # from joint to joint at q = 0
    ("shift", float, (7, 3)),
    ("mass", float, (7,)),
    ("com", float, (7, 3)),  # in the frame of the joint
    ("inertia", float, (7, 3, 3)),  # about the centre of mass
    ("gravity", float, (3,)),
    ("sole", float, (3,)),  # in the frame of joint 7
    ("sole_turn", float, (3, 3)),
    ("hand", float, (3,)),  # in the frame of joint 6
    ("hand_turn", float, (3, 3)),
    ("wanted", float, (3, 3)),  # rotation of the hand that the person keeps
]
_COMPUTED = [
    ("R", float, (7, 3, 3)),
    ("o", float, (7, 3)),
    ("I", float, (7, 6, 6)),
    *((name, float, (7, 6)) for name in ("S", "v", "c", "p", "U")),
    *((name, float, (7,)) for name in ("D", "u", "torques", "qdd")),
]
_OF_A_CYCLE = [
    ("midway", float),  # into the cycle, where the Jacobians are taken [s]
    ("A", float, (12, 7)),
    ("foot_rotation", float, (3, 3)),
    ("sum", float, (6,)),  # of the ground's wrench in the cycle
    ("hand_at", float, (3,)),
    ("motion", float, (9,)),  # of the sole, see fakes.ground.contact
    ("hand_rates", float, (6,)),
    ("tilt", float, (3,)),
]
LINKS = [*_FIXED, *_OF_A_CYCLE, *_COMPUTED]


def take_links(record: np.void, parts: ArmAndHand) -> None:
    """Take from the model what does not change."""
    model, sole, hand = parts
    for i in range(7):
        placement, body = model.jointPlacements[i + 1], model.inertias[i + 1]
        record["turn"][i] = placement.rotation
        record["shift"][i] = placement.translation
        record["mass"][i], record["com"][i] = body.mass, body.lever
        record["inertia"][i] = body.inertia
    record["gravity"] = model.gravity.linear
    for name, frame in (("sole", sole), ("hand", hand)):
        placement = model.frames[frame].placement
        record[name], record[f"{name}_turn"] = placement.translation, placement.rotation


@inline
def place_links(b, q, ahead, qd):
    """Place the frames of the joints at `q` + `ahead` `qd`: rotations R, origins o."""
    R, o = b.R, b.o
    for i in range(7):
        angle = q[i] + ahead * qd[i]
        c, s = math.cos(angle), math.sin(angle)
        turn, shift = b.turn[i], b.shift[i]
        for k in range(3):
            if i == 0:
                x, y, R[0, k, 2] = turn[k, 0], turn[k, 1], turn[k, 2]
                o[0, k] = shift[k]
            else:
                f, g, h = R[i - 1, k, 0], R[i - 1, k, 1], R[i - 1, k, 2]
                x = f * turn[0, 0] + g * turn[1, 0] + h * turn[2, 0]
                y = f * turn[0, 1] + g * turn[1, 1] + h * turn[2, 1]
                R[i, k, 2] = f * turn[0, 2] + g * turn[1, 2] + h * turn[2, 2]
                o[i, k] = o[i - 1, k] + f * shift[0] + g * shift[1] + h * shift[2]
            R[i, k, 0] = c * x + s * y
            R[i, k, 1] = c * y - s * x


@inline
def _point(b, i, point):
    """Return x, y, z of `point` of the frame of joint `i`."""
    o, R, x, y, z = b.o[i], b.R[i], point[0], point[1], point[2]
    return (
        o[0] + R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        o[1] + R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        o[2] + R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@inline
def _rotation(b, i, turn, out):
    """Fill `out` with the rotation of a frame turned by `turn` against joint `i`."""
    for k in range(3):
        for j in range(3):
            out[k, j] = (
                b.R[i, k, 0] * turn[0, j]
                + b.R[i, k, 1] * turn[1, j]
                + b.R[i, k, 2] * turn[2, j]
            )


@inline
def _jacobian(b, i, point, first):
    """Fill six rows of A from `first` on: velocity and turn of a point of link `i`."""
    A = b.A
    x, y, z = _point(b, i, point)
    for j in range(7):
        if j > i:
            for k in range(6):
                A[first + k, j] = 0.0
            continue
        ax, ay, az = b.R[j, 0, 2], b.R[j, 1, 2], b.R[j, 2, 2]
        rx, ry, rz = x - b.o[j, 0], y - b.o[j, 1], z - b.o[j, 2]
        A[first, j] = ay * rz - az * ry
        A[first + 1, j] = az * rx - ax * rz
        A[first + 2, j] = ax * ry - ay * rx
        A[first + 3, j], A[first + 4, j], A[first + 5, j] = ax, ay, az


@inline
def take_rates(b, qd):
    """Take the rates of sole and hand and the speeds of the motors at `qd`."""
    for i in range(19):
        total = 0.0
        if i < 12:
            for j in range(7):
                total += b.A[i, j] * qd[j]
        else:
            for j in range(7):
                total += b.j2mp[i - 12, j] * qd[j]
        if i < 6:
            b.motion[3 + i] = total
        elif i < 12:
            b.hand_rates[i - 6] = total
        else:
            b.speeds[i - 12] = total


@inline
def linearise(b, rows):
    """Take positions and Jacobians anew, once per cycle."""
    q, qd = rows[0], rows[1]
    place_links(b, q, 0.0, qd)
    b.motion[0], b.motion[1], b.motion[2] = _point(b, 6, b.sole)
    _rotation(b, 6, b.sole_turn, b.foot_rotation)
    b.hand_at[0], b.hand_at[1], b.hand_at[2] = _point(b, 5, b.hand)
    _take_tilt(b)
    place_links(b, q, b.midway, qd)
    _jacobian(b, 6, b.sole, 0)
    _jacobian(b, 5, b.hand, 6)
    take_rates(b, qd)


@inline
def _take_tilt(b):
    """Take by how much the hand is turned against where the person keeps it [rad]."""
    for k in range(3):
        row, column = (k + 2) % 3, (k + 1) % 3
        difference = 0.0
        for j in range(3):
            turned_column = turned_row = 0.0
            for n in range(3):
                turned_column += b.R[5, column, n] * b.hand_turn[n, j]
                turned_row += b.R[5, row, n] * b.hand_turn[n, j]
            difference += b.wanted[row, j] * turned_column
            difference -= b.wanted[column, j] * turned_row
        b.tilt[k] = 0.5 * difference


@inline
def accelerate(b, q, qd):
    """Fill qdd: accelerations of the joints under `torques`, with `armature`."""
    place_links(b, q, 0.0, qd)
    for i in range(7):
        _take_inertia(b, i)
        _take_motion(b, i, qd[i])
    for i in range(6, -1, -1):
        _carry_inwards(b, i)
    _accelerate_outwards(b)


@inline
def _take_inertia(b, i):
    """Fill I: spatial inertia of link `i` about the origin, shape (6, 6)."""
    R, J, I, m = b.R[i], b.inertia[i], b.I[i], b.mass[i]
    com = b.com[i]
    x = b.o[i, 0] + R[0, 0] * com[0] + R[0, 1] * com[1] + R[0, 2] * com[2]
    y = b.o[i, 1] + R[1, 0] * com[0] + R[1, 1] * com[1] + R[1, 2] * com[2]
    z = b.o[i, 2] + R[2, 0] * com[0] + R[2, 1] * com[1] + R[2, 2] * com[2]
    for k in range(3):
        f = R[k, 0] * J[0, 0] + R[k, 1] * J[1, 0] + R[k, 2] * J[2, 0]
        g = R[k, 0] * J[0, 1] + R[k, 1] * J[1, 1] + R[k, 2] * J[2, 1]
        h = R[k, 0] * J[0, 2] + R[k, 1] * J[1, 2] + R[k, 2] * J[2, 2]
        for n in range(3):
            I[k, n] = f * R[n, 0] + g * R[n, 1] + h * R[n, 2]
            I[k, n + 3] = I[k + 3, n] = I[k + 3, n + 3] = 0.0
        I[k + 3, k + 3] = m
    I[0, 0] += m * (y * y + z * z)
    I[1, 1] += m * (x * x + z * z)
    I[2, 2] += m * (x * x + y * y)
    I[0, 1] -= m * x * y
    I[0, 2] -= m * x * z
    I[1, 2] -= m * y * z
    I[1, 0], I[2, 0], I[2, 1] = I[0, 1], I[0, 2], I[1, 2]
    I[0, 4] = I[4, 0] = -m * z
    I[1, 3] = I[3, 1] = m * z
    I[0, 5] = I[5, 0] = m * y
    I[2, 3] = I[3, 2] = -m * y
    I[1, 5] = I[5, 1] = -m * x
    I[2, 4] = I[4, 2] = m * x


@inline
def _take_motion(b, i, rate):
    """Fill S, v, c and p of link `i`: axis, velocity, its bias and the force of it."""
    S, v, c, p = b.S[i], b.v[i], b.c[i], b.p[i]
    ax, ay, az = b.R[i, 0, 2], b.R[i, 1, 2], b.R[i, 2, 2]
    ox, oy, oz = b.o[i, 0], b.o[i, 1], b.o[i, 2]
    S[0], S[1], S[2] = ax, ay, az
    S[3], S[4], S[5] = oy * az - oz * ay, oz * ax - ox * az, ox * ay - oy * ax
    for k in range(6):
        own = S[k] * rate
        v[k] = own if i == 0 else b.v[i - 1, k] + own
    wx, wy, wz, vx, vy, vz = v[0], v[1], v[2], v[3], v[4], v[5]
    c[0] = rate * (wy * S[2] - wz * S[1])
    c[1] = rate * (wz * S[0] - wx * S[2])
    c[2] = rate * (wx * S[1] - wy * S[0])
    c[3] = rate * (wy * S[5] - wz * S[4] + vy * S[2] - vz * S[1])
    c[4] = rate * (wz * S[3] - wx * S[5] + vz * S[0] - vx * S[2])
    c[5] = rate * (wx * S[4] - wy * S[3] + vx * S[1] - vy * S[0])
    U = b.U[i]  # the momentum for now
    for k in range(6):
        total = 0.0
        for n in range(6):
            total += b.I[i, k, n] * v[n]
        U[k] = total
    nx, ny, nz, fx, fy, fz = U[0], U[1], U[2], U[3], U[4], U[5]
    p[0] = wy * nz - wz * ny + vy * fz - vz * fy
    p[1] = wz * nx - wx * nz + vz * fx - vx * fz
    p[2] = wx * ny - wy * nx + vx * fy - vy * fx
    p[3] = wy * fz - wz * fy
    p[4] = wz * fx - wx * fz
    p[5] = wx * fy - wy * fx


@inline
def _carry_inwards(b, i):
    """Fill U, D, u of joint `i`; add what the link is to the one before it."""
    S, U, I, p = b.S[i], b.U[i], b.I[i], b.p[i]
    D, u = b.armature[i], b.torques[i]
    for k in range(6):
        total = 0.0
        for n in range(6):
            total += I[k, n] * S[n]
        U[k] = total
        D += S[k] * total
        u -= S[k] * p[k]
    b.D[i], b.u[i] = D, u
    if i == 0:
        return
    c, share = b.c[i], u / D
    for k in range(6):
        part = U[k] / D
        force = p[k] + U[k] * share
        for n in range(6):
            rest = I[k, n] - part * U[n]
            b.I[i - 1, k, n] += rest
            force += rest * c[n]
        b.p[i - 1, k] += force


@inline
def _accelerate_outwards(b):
    g = b.gravity
    a, e, f, x, y, z = 0.0, 0.0, 0.0, -g[0], -g[1], -g[2]
    for i in range(7):
        c, U, S = b.c[i], b.U[i], b.S[i]
        a, e, f, x, y, z = a + c[0], e + c[1], f + c[2], x + c[3], y + c[4], z + c[5]
        inner = U[0] * a + U[1] * e + U[2] * f + U[3] * x + U[4] * y + U[5] * z
        qdd = (b.u[i] - inner) / b.D[i]
        b.qdd[i] = qdd
        a, e, f = a + S[0] * qdd, e + S[1] * qdd, f + S[2] * qdd
        x, y, z = x + S[3] * qdd, y + S[4] * qdd, z + S[5] * qdd
