"""Friction of a measured terrain for MuJoCo Playground and MJX.

    raise_floor(env.mj_model, floor_geom=0)   # before mjx.put_model
    randomization_fn = with_terrain(go1.domain_randomize, "S0", floor_geom=0)

One coefficient an episode is drawn for the floor, column 0 of `geom_friction`; what
the randomiser that is wrapped draws otherwise stays. MuJoCo takes the larger friction
of two geoms unless their priorities differ, so the floor needs the higher priority.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from traction_profile import PROFILES, load_profile

try:
    import jax
    import jax.numpy as jnp
except ImportError:  # the floor can be raised without
    jax = jnp = None  # type: ignore[assignment]

_STREAM = 0x7261  # apart from the keys of the randomiser that is wrapped
REFUSAL = (
    "MuJoCo takes the larger friction of two geoms unless their priorities differ: "
    "the feet's would hide the floor's. Call raise_floor before mjx.put_model."
)


def has_priority(model: Any, floor_geom: int) -> bool:
    """Return whether the floor's friction counts against every other geom's."""
    priority = np.asarray(model.geom_priority)
    return bool((np.delete(priority, floor_geom) < priority[floor_geom]).all())


def raise_floor(mj_model: Any, floor_geom: int = 0) -> None:
    """Give the floor a priority above all other geoms of a mujoco.MjModel."""
    others = np.delete(np.asarray(mj_model.geom_priority), floor_geom)
    mj_model.geom_priority[floor_geom] = int(others.max(initial=-1)) + 1


def with_terrain(
    base: Callable[[Any, Any], tuple[Any, Any]] | None,
    terrain: str,
    floor_geom: int = 0,
    path: Any = PROFILES,
) -> Callable[[Any, Any], tuple[Any, Any]]:
    """Return a randomiser that draws the floor's friction from a terrain.

    Args:
        base: the randomiser whose other draws stay; None = there is none.
        terrain: its name in the database.
        floor_geom: number of the floor's geom.
        path: of `profile.json`.

    Raises:
        KeyError: there is no such terrain.
    """
    profile = load_profile(terrain, path)
    shares, mu = jnp.asarray(profile.shares), jnp.asarray(profile.mu)

    def randomize(model: Any, rng: Any) -> tuple[Any, Any]:
        """Return the model and its axes; `rng` has the shape (num_envs, 2).

        Raises:
            ValueError: the feet's friction would hide the floor's.
        """
        if not has_priority(model, floor_geom):
            raise ValueError(REFUSAL)
        if base is None:
            made, in_axes = model, jax.tree_util.tree_map(lambda _: None, model)
        else:
            made, in_axes = base(model, rng)

        def draw(key: Any) -> Any:
            own = jax.random.fold_in(key, _STREAM)
            share = jax.random.uniform(own, minval=shares[0], maxval=shares[-1])
            return jnp.interp(share, shares, mu)

        drawn = jax.vmap(draw)(rng)
        shape = (drawn.shape[0], *model.geom_friction.shape[-2:])
        friction = jnp.broadcast_to(made.geom_friction, shape)
        friction = friction.at[:, floor_geom, 0].set(drawn)
        return (
            made.tree_replace({"geom_friction": friction}),
            in_axes.tree_replace({"geom_friction": 0}),
        )

    return randomize
