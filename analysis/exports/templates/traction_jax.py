"""Traction of terrains as pure functions of JAX: jit, vmap and grad go through them.

    terrains = load()                             # beside this file
    F_t = quantiles(terrains["S0"], F_n, v_t)     # [N], by share
    p = risk_sliding(terrains["S0"], F_t, F_n, v_t)
    mu = sample_mu(terrains["S0"], key, (4096,))  # once an episode

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


def load(path: Path | str = _HERE / "terrains.json") -> dict[str, TerrainParams]:
    """Return every terrain of a file by its name in the database."""
    content = json.loads(Path(path).read_text())
    return {
        name: TerrainParams(*(jnp.asarray(terrain[k]) for k in TerrainParams._fields))
        for name, terrain in content["terrains"].items()
    }


def _place(axis: jax.Array, values: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the points below values and the share of the way to the next, clamped."""
    inside = jnp.clip(values, axis[0], axis[-1])
    i = jnp.clip(jnp.searchsorted(axis, inside, side="right") - 1, 0, axis.size - 2)
    return i, (inside - axis[i]) / (axis[i + 1] - axis[i])


def quantiles(params: TerrainParams, F_n: jax.Array, v_t: jax.Array) -> jax.Array:
    """Return F_t [N] of a sliding foot by share, shape (..., q)."""
    F_n, v_t = jnp.broadcast_arrays(jnp.asarray(F_n, float), jnp.asarray(v_t, float))
    i, a = _place(params.F_n, F_n)
    j, b = _place(params.v_t, v_t)
    a, b, table = a[..., None], b[..., None], params.forces
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
