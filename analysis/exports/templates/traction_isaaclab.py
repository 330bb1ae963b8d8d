"""Friction of a measured terrain for Isaac Lab.

    EventTerm(
        func=mdp.randomize_rigid_body_material,
        mode="startup",
        params={
            "asset_cfg": SceneEntityCfg("robot", body_names=".*_foot"),
            **feet_friction("S0"),
        },
    )
    TerrainImporterCfg(
        ..., physics_material=sim_utils.RigidBodyMaterialCfg(**GROUND)
    )

The term draws for the *feet*; with the ground at 1 and "multiply" the product is what
was measured. Static and dynamic friction are drawn apart and uniformly between the
ends: no tails, and a wider middle than measured. Every shape gets a bucket of its own,
so feet that stand on one ground differ. On the Newton backend the dynamic range and the
buckets are ignored; its solvers combine by mean, root or maximum: there only
ground = foot is right.
"""

from typing import Any

from traction_profile import PROFILES, load_profile

GROUND = {
    "static_friction": 1.0,
    "dynamic_friction": 1.0,
    "friction_combine_mode": "multiply",
    "restitution_combine_mode": "multiply",
}


def feet_friction(
    terrain: str, num_buckets: int = 64, path: Any = PROFILES
) -> dict[str, Any]:
    """Return parameters of `randomize_rigid_body_material` for the feet.

    Dynamic friction has the 5 and 95 % points of the coefficient per episode, static
    friction the same times that from rest over the sliding one.

    Args:
        terrain: its name in the database.
        num_buckets: materials that are drawn at the start; PhysX takes 64,000 at most.
        path: of `profile.json`.

    Raises:
        KeyError: there is no such terrain.
    """
    profile = load_profile(terrain, path)
    low, high = profile.range()
    ratio = profile.static_over_sliding
    return {
        "static_friction_range": (ratio * low, ratio * high),
        "dynamic_friction_range": (low, high),
        "restitution_range": (0.0, 0.0),
        "num_buckets": num_buckets,
        "make_consistent": True,
    }
