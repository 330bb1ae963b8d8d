"""Friction of a measured terrain for mjlab.

    EventTermCfg(
        func=terrain_friction,
        mode="reset",
        params={
            "asset_cfg": SceneEntityCfg("terrain", geom_names=("terrain",)),
            "terrain": "S0",
        },
    )

The geoms that are named need a priority above all others (`priority=1`), because MuJoCo
takes the larger friction of two geoms otherwise. `friction_range("S0")` goes into
`ranges` of `dr.geom_friction` where a distribution cannot.
"""

from typing import Any

import numpy as np
from traction_profile import PROFILES, load_profile

try:
    import torch
    from mjlab.managers.event_manager import requires_model_fields
except ImportError:  # ranges and draws can be had without
    torch = None

    def requires_model_fields(*_: str) -> Any:
        """Stand in for mjlab's decorator, which tells what is written per world."""
        return lambda function: function


def friction_range(terrain: str, path: Any = PROFILES) -> tuple[float, float]:
    """Return the 5 and 95 % points of the coefficient, for `ranges`, axis 0.

    Uniform between them has no tails and a wider middle; `uniform_distance` says how
    far it is from what was measured.
    """
    return load_profile(terrain, path).range()


def uniform_distance(terrain: str, path: Any = PROFILES) -> float:
    """Return the distance of a uniform draw from the measured distribution, 0 to 1.

    It is Kolmogorov and Smirnov's, the largest difference of their functions.
    """
    profile = load_profile(terrain, path)
    low, high = profile.range()
    uniform = np.clip((profile.mu - low) / max(high - low, 1e-12), 0.0, 1.0)
    return float(np.abs(uniform - profile.shares).max())


@requires_model_fields("geom_friction")
def terrain_friction(
    env: Any, env_ids: Any, asset_cfg: Any, terrain: str, path: Any = PROFILES
) -> None:
    """Draw one coefficient a world and write it to the geoms, axis 0.

    Args:
        env: the environment.
        env_ids: worlds that are reset; None = all.
        asset_cfg: the entity and its geoms.
        terrain: its name in the database.
        path: of `profile.json`.

    Raises:
        KeyError: there is no such terrain.
    """
    profile = load_profile(terrain, path)
    if env_ids is None:
        env_ids = torch.arange(env.num_envs, device=env.device)
    uniform = torch.rand(len(env_ids), device=env.device)
    drawn = profile.draw(uniform.cpu().numpy())
    geoms = env.scene[asset_cfg.name].indexing.geom_ids[asset_cfg.geom_ids]
    values = torch.as_tensor(drawn, dtype=torch.float32, device=env.device)
    friction = env.sim.model.geom_friction
    friction[env_ids[:, None], geoms[None, :], 0] = values[:, None]
