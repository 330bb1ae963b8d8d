"""Traction of terrains as pure functions of JAX: jit, vmap and grad go through them.

    terrains = load()                             # beside this file
    F_t = quantiles(terrains["S0"], F_n, v_t)     # [N], by share
    p = risk_sliding(terrains["S0"], F_t, F_n, v_t)
    mu = sample_mu(terrains["S0"], key, (4096,))  # once an episode
    F_t, jam = contact_step(terrains["S0"], jam, dt, x, v, F_n, draw(key))
    F_t = sample(terrains["S0"], F_n, v_t, key)   # a motion, a row every 10 ms

Forces in N, velocities in m/s; arguments of any shapes that broadcast. Linear between
the points of a table, of its edge outside; NaN stays NaN.
"""

import json
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.special import ndtr

_HERE = Path(__file__).parent


# Of the contact law: capacity, damping, creep, skin friction, the air.
_FULL_LOAD, _LEAST_LOAD, _LEAST_DROP = 3.5, 0.8, 1.5
_DAMPING, _CREEP_LOAD = 20.0, 0.14
_SKIN_SPEED, _TOUCH, _ALOFT, _FIRST_FORCE = 0.01, 0.05, 1.0, 1.0
_BEFORE = 50  # samples that a path goes before its first one


class SampleParams(NamedTuple):
    """The generator of a terrain, a pytree of arrays.

    Attributes:
        weights: of K experts, shape (K, 14).
        sd: of their increments [N], shape (K,).
        gate: shape (K, 17).
        centre: of the gate's numbers, shape (17,).
        scale: of the same, shape (17,).
        knots: of the drift [m/s], shape (9,).
        drift: at them [N], shape (9,).
        F_n: axis of the bands [N], shape (n,).
        v_t: axis of the bands [m/s], shape (m,).
        bands: low, median and high of a new trial [N], shape (n, m, 3).
        level: spread between trials [N] and its degrees of freedom, shape (2,).
        ends: smallest and largest force less the level of the trial [N], shape (2,).
    """

    weights: jax.Array
    sd: jax.Array
    gate: jax.Array
    centre: jax.Array
    scale: jax.Array
    knots: jax.Array
    drift: jax.Array
    F_n: jax.Array
    v_t: jax.Array
    bands: jax.Array
    level: jax.Array
    ends: jax.Array


class Jam(NamedTuple):
    """What the contact law remembers of a foot; begins with `jam_before`.

    Attributes:
        is_jammed: stones are stretched.
        anchor: where they are not [m].
        capacity: at 3.5 N or more, of the jam or of the next one [N].
        stiffness: of the same [N/m].
        engage_at: where the next one begins [m].
        aloft: time in the air [s].
    """

    is_jammed: jax.Array
    anchor: jax.Array
    capacity: jax.Array
    stiffness: jax.Array
    engage_at: jax.Array
    aloft: jax.Array


class TerrainParams(NamedTuple):
    """One terrain, a pytree of arrays.

    Attributes:
        F_n: axis of the table [N], shape (n,).
        v_t: axis of the table [m/s], shape (m,).
        forces: F_t [N] by share, shape (n, m, q).
        scores: normal scores of the shares, shape (q,).
        mu_shares: of the quantiles of mu, shape (k,).
        mu: coefficient of friction per episode, shape (k,).
        rest_law: is_log, level and slope of the law of a push from rest, shape (3,).
        rest_distances: from its centre, shape (r,); empty = not known.
        rest_risks: probability of a slip there, shape (r,).
        contact: numbers of the contact law, shape (12,); empty = not known.
        sample: the generator; None = not known.
    """

    F_n: jax.Array
    v_t: jax.Array
    forces: jax.Array
    scores: jax.Array
    mu_shares: jax.Array
    mu: jax.Array
    rest_law: jax.Array
    rest_distances: jax.Array
    rest_risks: jax.Array
    contact: jax.Array
    sample: SampleParams | None


def load(path: Path | str = _HERE / "terrains.json") -> dict[str, TerrainParams]:
    """Return every terrain of a file by its name in the database."""
    content = json.loads(Path(path).read_text())
    return {name: _params(each) for name, each in content["terrains"].items()}


def _params(terrain: dict) -> TerrainParams:
    fields = [name for name in TerrainParams._fields if name != "sample"]
    arrays = {name: jnp.asarray(terrain[name], float) for name in fields}
    generator = terrain["sample"]
    if generator is not None:
        names = SampleParams._fields
        generator = SampleParams(*(jnp.asarray(generator[k], float) for k in names))
    return TerrainParams(**arrays, sample=generator)


def _place(axis: jax.Array, values: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the points below values and the share of the way to the next, clamped."""
    inside = jnp.clip(values, axis[0], axis[-1])
    i = jnp.clip(jnp.searchsorted(axis, inside, side="right") - 1, 0, axis.size - 2)
    return i, (inside - axis[i]) / (axis[i + 1] - axis[i])


def quantiles(params: TerrainParams, F_n: jax.Array, v_t: jax.Array) -> jax.Array:
    """Return F_t [N] of a sliding foot by share, shape (..., q)."""
    return _blended(params.F_n, params.v_t, params.forces, F_n, v_t)


def _blended(
    loads: jax.Array,
    speeds: jax.Array,
    table: jax.Array,
    F_n: jax.Array,
    v_t: jax.Array,
) -> jax.Array:
    """Return what a table over loads and speeds has at points, shape (..., q)."""
    F_n, v_t = jnp.broadcast_arrays(jnp.asarray(F_n, float), jnp.asarray(v_t, float))
    i, a = _place(loads, F_n)
    j, b = _place(speeds, v_t)
    a, b = a[..., None], b[..., None]
    left = table[i, j] + b * (table[i, j + 1] - table[i, j])
    right = table[i + 1, j] + b * (table[i + 1, j + 1] - table[i + 1, j])
    return left + a * (right - left)


def risk_sliding(
    params: TerrainParams, F_t: jax.Array, F_n: jax.Array, v_t: jax.Array
) -> jax.Array:
    """Return the probability that a sliding foot meets less than F_t [N]."""
    forces = quantiles(params, F_n, v_t)
    F_t, _ = jnp.broadcast_arrays(jnp.asarray(F_t, float), forces[..., 0])
    forces = jnp.broadcast_to(forces, (*F_t.shape, forces.shape[-1]))
    i = (forces[..., 1:-1] <= F_t[..., None]).sum(axis=-1)
    low, high = (
        jnp.take_along_axis(forces, k[..., None], axis=-1)[..., 0] for k in (i, i + 1)
    )
    way = (F_t - low) / jnp.maximum(high - low, 1e-9)
    scores = params.scores
    return ndtr(scores[i] + way * (scores[i + 1] - scores[i]))


def risk_rest(params: TerrainParams, F_t: jax.Array, F_n: jax.Array) -> jax.Array:
    """Return the probability that a push from rest slips before F_t [N], F_n held.

    NaN where the terrain was not pushed from rest, and for negative forces.
    """
    F_t, F_n = jnp.broadcast_arrays(jnp.asarray(F_t, float), jnp.asarray(F_n, float))
    if params.rest_distances.size == 0:
        return jnp.full(F_t.shape, jnp.nan)
    is_log, level, slope = params.rest_law
    least = jnp.finfo(F_t.dtype).tiny
    in_log = jnp.log(jnp.maximum(F_t, least)) - slope * jnp.log(
        jnp.maximum(F_n, 1.0) / 3.5
    )
    distance = jnp.where(is_log > 0.5, in_log, F_t - slope * F_n) - level
    risk = jnp.interp(distance, params.rest_distances, params.rest_risks)
    return jnp.where((F_t >= 0.0) & (F_n >= 0.0), risk, jnp.nan)


def sample_mu(
    params: TerrainParams, key: jax.Array, shape: tuple[int, ...] = ()
) -> jax.Array:
    """Return coefficients of friction, each for a whole episode."""
    ends = params.mu_shares[0], params.mu_shares[-1]
    share = jax.random.uniform(key, shape, minval=ends[0], maxval=ends[1])
    return jnp.interp(share, params.mu_shares, params.mu)


def jam_before() -> Jam:
    """Return the contact before the first touch."""
    zero = jnp.zeros(())
    return Jam(jnp.asarray(False), zero, zero + 1.0, zero + 1.0, zero, zero + _ALOFT)


def draw(key: jax.Array) -> jax.Array:
    """Return random numbers of one step: two uniform, two normal, shape (4,)."""
    first, second = jax.random.split(key)
    least = jnp.finfo(jnp.zeros(()).dtype).tiny
    u = jax.random.uniform(first, (2,), minval=least)
    return jnp.concatenate([u, jax.random.normal(second, (2,))])


def contact_step(
    params: TerrainParams,
    jam: Jam,
    dt: jax.Array,
    x: jax.Array,
    v: jax.Array,
    F_n: jax.Array,
    draw: jax.Array,
) -> tuple[jax.Array, Jam]:
    """Return F_t [N] of a foot that a simulator moves, and the contact after a step.

    One foot; vmap for more. F_t is against x. NaN where the terrain has no law.

    Args:
        params: of the terrain.
        jam: the contact before.
        dt: length of the step [s], a millisecond or less.
        x: place of the foot along the push [m].
        v: its velocity [m/s].
        F_n: normal force [N].
        draw: random numbers of this step, shape (4,).
    """
    if params.contact.size == 0:
        return jnp.full(jnp.shape(x), jnp.nan), jam
    level, load, spread, stiffness, stiffness_spread = params.contact[:5]
    run, run_shape, mu, viscosity, rate, share, creep = params.contact[5:]
    u0, u1, z0, z1 = draw
    new_p = jnp.exp(level + spread * z0)
    new_k = jnp.exp(stiffness + stiffness_spread * z1)
    is_new = jam.aloft >= _ALOFT
    p = jnp.where(is_new, new_p, jam.capacity)
    k = jnp.where(is_new, new_k, jam.stiffness)
    x_e = jnp.where(is_new, x, jam.engage_at)
    skin = mu * F_n
    begun = jnp.where(v > 0.0, x - jnp.minimum(skin, _FIRST_FORCE) / k, x)
    a = jnp.where(jam.is_jammed, jam.anchor, begun)
    P = p * (jnp.clip(F_n, _LEAST_LOAD, _FULL_LOAD) / _FULL_LOAD) ** load
    stretched = jnp.minimum(k * (x - a) / P, 1.0)
    crept = creep * jnp.exp((stretched - 1.0) / _CREEP_LOAD) * dt
    a = a + jnp.where(x > a, crept, 0.0)
    F = k * (x - a)
    is_back = -skin > F
    is_free = ~jam.is_jammed & (x < x_e)
    is_over = ~is_back & (P < F)
    is_partial = ~is_over & (F > _LEAST_DROP) & (u0 < rate * v * dt)
    F = jnp.where(is_back, -skin, F)
    left = (F - _LEAST_DROP) * (1.0 - u1 ** (1.0 / share - 1.0))
    F = jnp.where(is_partial, left, F)
    a = jnp.where(is_back | is_partial, x - F / k, a)
    free = skin * jnp.clip(v / _SKIN_SPEED, -1.0, 1.0) + viscosity * v
    force = jnp.where(F > 0.0, F + _DAMPING * v, F)
    is_jammed = ~is_free & ~is_over
    is_new = is_over & ~is_free
    touching = Jam(
        is_jammed=is_jammed,
        anchor=jnp.where(is_jammed, a, jam.anchor),
        capacity=jnp.where(is_new, new_p, p),
        stiffness=jnp.where(is_new, new_k, k),
        engage_at=jnp.where(is_new, x + run * (-jnp.log(u1)) ** (1.0 / run_shape), x_e),
        aloft=jnp.zeros_like(jam.aloft),
    )
    is_aloft = F_n <= _TOUCH
    lifted = jam._replace(is_jammed=jnp.zeros_like(is_jammed), aloft=jam.aloft + dt)
    after = jax.tree.map(lambda b, c: jnp.where(is_aloft, b, c), lifted, touching)
    return jnp.where(is_aloft, 0.0, jnp.where(is_jammed, force, free)), after


def sample(
    params: TerrainParams, F_n: jax.Array, v_t: jax.Array, key: jax.Array
) -> jax.Array:
    """Return F_t [N] that a new trial may show along a motion, shape (T,).

    NaN where the terrain has no generator.

    Args:
        params: of the terrain.
        F_n: normal force [N] every 10 ms, shape (T,).
        v_t: velocity [m/s], shape (T,).
        key: of the draws.
    """
    if params.sample is None:
        return jnp.full(jnp.shape(F_n), jnp.nan)
    of_level, of_square, of_u, of_z = jax.random.split(key, 4)
    between, freedom = params.sample.level
    square = 2.0 * jax.random.gamma(of_square, 0.5 * freedom)
    level = between * jax.random.normal(of_level) * jnp.sqrt(freedom / square)
    count = jnp.shape(F_n)[0] + _BEFORE - 1
    u, z = jax.random.uniform(of_u, (count,)), jax.random.normal(of_z, (count,))
    return level + sample_path(params.sample, F_n, v_t, u, z)


def sample_path(
    params: SampleParams, F_n: jax.Array, v_t: jax.Array, u: jax.Array, z: jax.Array
) -> jax.Array:
    """Return F_t less the level of the trial [N] by draws of one's own, shape (T,).

    Args:
        params: of the generator.
        F_n: normal force [N] every 10 ms, shape (T,).
        v_t: velocity [m/s], shape (T,).
        u: uniform, shape (T + 49,).
        z: normal, shape (T + 49,).
    """
    F_n, v_t = (
        jnp.concatenate([jnp.full((_BEFORE,), c[0]), c])
        for c in (jnp.asarray(F_n, float), jnp.asarray(v_t, float))
    )
    bands = _blended(params.F_n, params.v_t, params.bands, F_n, v_t)
    drift = jnp.interp(v_t, params.knots, params.drift)
    zero = jnp.zeros(())

    def step(state: tuple, now: tuple) -> tuple[tuple, jax.Array]:
        F, D, f, v, m, w, h = state
        new_f, new_v, (low, new_m, high), pushed, u, z = now
        w = w + 0.2 * (new_v - w)
        h = h + 0.02 * (jnp.abs(w) - h)
        forward, backward = jnp.maximum(new_v, 0.0), jnp.minimum(new_v, 0.0)
        x = (1.0, F, D, F * forward, F * w, new_f, new_f - f, forward, backward)
        x = jnp.stack([*(zero + n for n in x), new_v - v, v, w, new_m, new_m - m])
        share = jnp.minimum(jnp.abs(new_v) / 0.02, 1.0)
        more = jnp.stack([F / jnp.maximum(new_f, 0.8), F * share, share])
        g = (jnp.concatenate([x, more]) - params.centre) / params.scale
        g = jnp.clip(g, -4.0, 4.0).at[0].set(1.0)
        shares = jnp.cumsum(jax.nn.softmax(params.gate @ g))
        k = (shares[:-1] <= u * shares[-1]).sum()
        fade = jnp.clip((h - 0.002) / 0.004, 0.0, 1.0)
        new = F + fade * (params.weights[k] @ x + pushed + params.sd[k] * z)
        new = new - jnp.where(jnp.abs(new_v) < 0.008, 0.01, 0.003) * (new - new_m)
        new = new - 0.5 * jnp.minimum(new - low, 0.0)
        new = new - 0.1 * jnp.maximum(new - high, 0.0)
        new = jnp.clip(new, params.ends[0], params.ends[1])
        return (new, new - F, new_f, new_v, new_m, w, h), new

    first = (bands[0, 1], zero, F_n[0], v_t[0], bands[0, 1], v_t[0], jnp.abs(v_t[0]))
    rows = (F_n[1:], v_t[1:], bands[1:], drift[1:], u, z)
    return jax.lax.scan(step, first, rows)[1][_BEFORE - 1 :]
