# pyright: basic
"""Steps of plate, bed of stones, footing and boards over a record of plain numbers.

Number by number the operations of `terrain`, `stones`, `jams` and `footing`, in their
order, so that the results are the same to the last bit. A step that needs a draw stops
and says which; when it is called again, it goes on where it stopped.

`g` is a record of `layout.GROUND`, `dt` the time step [s], `m` the motion of the sole,
nine numbers in the order of `contact.Motion`.
"""

import math

from fakes.ground.compiled.layout import (
    AFTER_THE_STONES,
    ALONG_THE_STONES,
    BED,
    BEGIN,
    BROKEN,
    CHANCES,
    COLLAPSED,
    DONE,
    LANDED,
    ON_THE_GROUND,
    OUT_OF_CHANCES,
    PLATE,
    SHUFFLED,
    TOTAL,
)
from fakes.ground.footing import K_TURN, TURN_PER_N
from fakes.ground.jams import A_C, LAM0, LAM1, LITTLE, MU_R, Q0, TAU, TOUCH, V_C
from fakes.ground.profile import locate
from fakes.ground.stones import FIRM, L_S, LIFTED, MU_LATERAL, STEEPEST_SLOPE
from fakes.ground.terrain import BOARD_B, BOARD_K, BOARD_MU, FREE, RIM
from fakes.kernels.compiler import inline

_locate = inline(locate)


@inline
def _at(table, x):
    row, share = _locate(x)
    return table[row] + share * (table[row + 1] - table[row])


@inline
def _clipped(value, limit):
    return limit if value > limit else -limit if value < -limit else value


@inline
def _release(g):
    g.aside = g.turn_x = g.turn_y = g.turn_z = 0.0
    for i in range(6):
        g.contact[i] = 0.0


@inline
def _stand(g, dt, m, F_t, F_n, mu):
    """Let the footing add what the sole's size does; fill the contact."""
    contact = g.contact
    if F_n <= 0.0:
        _release(g)
        contact[0] = F_t
        return
    x, y = _at(g.cop_x, m[0]), _at(g.cop_y, m[0])
    k, most = g.k_lateral, TURN_PER_N * F_n
    g.aside = _clipped(g.aside + m[4] * dt, mu * F_n / k)
    g.turn_x = _clipped(g.turn_x + m[6] * dt, most)
    g.turn_y = _clipped(g.turn_y + m[7] * dt, most)
    g.turn_z = _clipped(g.turn_z + m[8] * dt, most)
    F_y = -k * g.aside
    contact[0] = F_t
    contact[1] = F_y
    contact[2] = F_n
    contact[3] = y * F_n - K_TURN * g.turn_x
    contact[4] = -x * F_n - K_TURN * g.turn_y
    contact[5] = x * F_y + y * F_t - K_TURN * g.turn_z


@inline
def _plate_step(g, dt, m):
    x, z, v, vz = m[0], m[2], m[3], m[5]
    if z >= 0.0:
        g.bristle = g.pressed = 0.0
        _release(g)
        return
    F_n = -g.k_n * z - g.c_n * vz
    F_n = F_n if F_n > 0.0 else 0.0
    level = g.level * _at(g.profile, x)
    share = v / g.v_S
    friction = (g.mu_k + (g.mu_s - g.mu_k) * math.exp(-(share * share))) * level
    before = g.bristle
    if F_n > g.pressed:
        before *= g.pressed / F_n
    g.pressed = F_n
    bristle = (before + dt * v) / (1.0 + dt * g.s0 * abs(v) / friction)
    g.bristle = bristle = _clipped(bristle, g.mu_s * level / g.s0)
    rate = (bristle - before) / dt
    light = F_n if F_n < 1.0 else 1.0
    F_t = F_n * (g.s0 * bristle + g.s1 * rate) + g.b * v * light
    _stand(g, dt, m, F_t, F_n, g.mu_k)


@inline
def _touch(g, dt, m):
    """Meet the surface; return what is to be drawn."""
    x, z = m[0], m[2]
    is_fresh = g.aloft >= LIFTED and abs(x - g.stood_at) >= g.away  # NaN: nowhere yet
    sink = 0.0 if is_fresh else g.sink
    depth = _at(g.profile, x) - sink - z
    if depth <= 0.0:
        g.aloft += dt
        g.elastic, g.is_loaded = 0.0, 0
        g.anchor[:] = math.nan
        _release(g)
        return DONE
    g.depth, g.sunk_before = depth, sink
    g.phase = ON_THE_GROUND
    g.aloft = 0.0
    if is_fresh:
        g.sink = 0.0
        return LANDED
    return DONE


@inline
def _press(g, dt, m):
    """Take the normal force, sink, and load the jam."""
    x, vx, vz, sink = m[0], m[3], m[5], g.sunk_before
    g.stood_at = x
    slope = _at(g.slope, x)
    F_n = g.k_n * g.depth + g.c_n * (slope * vx - vz)
    F_n = F_n if F_n > 0.0 else 0.0
    g.F_n, g.slope_here, g.sunk = F_n, slope, sink / g.sink_limit
    if vx > 0.0:
        rate = vx * (g.sink_limit - sink) / L_S
        g.sink = sink + dt * rate * (F_n / FIRM if F_n < FIRM else 1.0)
    if g.is_loaded:
        g.age += dt
    aged = Q0 + (1.0 - Q0) * (1.0 - math.exp(-g.age / TAU))
    strength, grip = g.J * aged, F_n * g.T
    capacity = strength if strength < grip else grip
    g.capacity_now = capacity = capacity if capacity > LITTLE else LITTLE
    load = g.elastic / capacity
    g.creep = V_C * math.exp((load - 1.0) / A_C) * dt if 0.3 < load < 1.5 else 0.0
    g.skin = MU_R * F_n / g.weights
    g.elastic_sum = g.rolling = 0.0
    g.pushed = g.detached = g.stone = 0
    g.phase = ALONG_THE_STONES


@inline
def _pass_stones(g, m):
    """Load one stone after the other; stop behind one that breaks."""
    x, skin = m[0], g.skin
    while g.stone < g.count:
        i = g.stone
        g.stone += 1
        anchor = g.anchor[i]
        if math.isnan(anchor):
            g.rolling += g.weight[i]
            g.detached += 1
            if x > g.engage_at[i] and g.F_n > TOUCH:
                g.anchor[i] = x
            continue
        anchor += g.creep
        force = g.k[i] * (x - anchor)
        if force > g.capacity[i]:
            g.rolling += g.weight[i]
            return BROKEN
        if force > 0.0:
            g.pushed += 1
        elif force < -skin * g.weight[i]:
            force = -skin * g.weight[i]
            anchor = x - force / g.k[i]
        g.anchor[i] = anchor
        g.elastic_sum += force
    g.elastic = g.elastic_sum
    g.is_loaded = 1 if g.detached < g.count else 0
    g.phase = AFTER_THE_STONES
    return DONE


@inline
def _collapse_or_shuffle(g, dt):
    if not g.is_loaded:
        g.phase = TOTAL
        return DONE
    load = g.elastic_sum / g.capacity_now
    if load > 1.0:
        g.phase = TOTAL
        return COLLAPSED
    if g.chance >= CHANCES:
        return OUT_OF_CHANCES
    chance = g.chances[g.chance]
    g.chance += 1
    g.phase = TOTAL
    return SHUFFLED if chance < (LAM0 + LAM1 * load * load) * dt else DONE


@inline
def _bed_step(g, dt, m):
    """Go through the phases of a step until one waits for a draw."""
    event = DONE
    if g.phase == BEGIN:
        event = _touch(g, dt, m)
        if event != DONE or g.phase == BEGIN:
            return event
    if g.phase == ON_THE_GROUND:
        _press(g, dt, m)
    if g.phase == ALONG_THE_STONES:
        event = _pass_stones(g, m)
        if event != DONE:
            return event
    if g.phase == AFTER_THE_STONES:
        event = _collapse_or_shuffle(g, dt)
        if event != DONE:
            return event
    vx, F_n, slope = m[3], g.F_n, g.slope_here
    F_t = g.elastic_sum + (g.c_t * g.pushed + g.b_g * g.detached) * vx
    if g.rolling != 0.0:
        F_t += g.skin * g.rolling * math.tanh(vx / 0.01)
    F_t += F_n * _clipped(slope, STEEPEST_SLOPE)
    _stand(g, dt, m, F_t, F_n, MU_LATERAL)
    g.phase = BEGIN
    return DONE


@inline
def _rub_boards(g, m):
    """Let the boards of the container push back."""
    y, vx, vy = m[1], m[3], m[4]
    if -FREE <= y <= FREE or m[2] > RIM:
        return
    depth = abs(y) - FREE
    side = math.copysign(1.0, y)
    shared = BOARD_K * depth + BOARD_B * side * vy
    shared = shared if shared > 0.0 else 0.0
    g.contact[0] += BOARD_MU * shared * math.tanh(vx / 0.01)
    g.contact[1] -= side * shared


@inline
def ground_step(g, dt, m):
    """Advance the ground; return `DONE`, or what is to be drawn before it can go on."""
    if g.kind == PLATE:
        _plate_step(g, dt, m)
    elif g.kind == BED:
        event = _bed_step(g, dt, m)
        if event != DONE:
            return event
    if g.has_boards:
        _rub_boards(g, m)
    return DONE
