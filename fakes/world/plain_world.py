"""A simulated rig from plain values, as passed to its own process."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from acquisition.clock import Clock
from fakes.ground.terrain import GroundChoice, PlateParameters
from fakes.plant.model import PlantOptions
from fakes.plant.push import PACES
from fakes.sensor.kinds import SensorChoice
from fakes.world.deviation import RigDeviation, draw_sound_rig
from fakes.world.rig import FakeRig, LocalSimulation, SimulatedScene
from fakes.world.wrong_rigs import wrong_rig
from ft_sensor.payload import TerrainFrame
from wam.model.constants import ArmConstants
from wam.model.tool import tool_of


def _scene_of(fields: Mapping[str, Any]) -> SimulatedScene:
    """Return the scene from its plain values."""
    frame = fields["frame"]
    return SimulatedScene(
        terrain=fields["terrain"],
        ground=GroundChoice(
            fields["stones"],
            fields["foot"],
            None if fields.get("sole") is None else PlateParameters(**fields["sole"]),
            fields.get("effects", {}),
        ),
        frame=TerrainFrame(
            frame["incline"],
            frame["heading"],
            tuple(frame["far_end"]),
            frame["travel"],
        ),
        start_q=np.array(fields["start_q"]),
        seed=fields["seed"],
        sensor=SensorChoice(**fields["sensor"]),
        deviation=deviation_from(fields.get("truth"), fields["seed"]),
    )


def deviation_from(truth: Mapping[str, Any] | None, seed: int) -> RigDeviation | None:
    """Return the deviation of a rig from its settings; None = none.

    Args:
        truth: "spread": draw a sound rig; "mount": rotations of its base about x, y, z
            [degrees]; "wrong": name of a faulty rig for `--wrong`, "" = none.
        seed: seed of the sound rig.
    """
    if truth is None:
        return None
    sound = draw_sound_rig(seed) if truth["spread"] else RigDeviation()
    mount = np.radians(np.array(truth["mount"], dtype=np.float64))
    mounted = RigDeviation(mount=mount).on(sound)
    name = truth["wrong"]
    return wrong_rig(name).deviation.on(mounted) if name else mounted


def simulated_rig(
    fields: Mapping[str, Any], constants: ArmConstants, clock: Clock
) -> LocalSimulation:
    """Return the simulation from its plain values.

    Args:
        fields: scene, tool, factor on the friction, pace, cables.
        constants: constants of the arm from its drawings.
        clock: clock of the simulated world.
    """
    scene = _scene_of(fields["scene"])
    options = PlantOptions(
        fields["friction"], seed=scene.seed, cables=fields.get("cables")
    )
    rig = FakeRig(scene, constants, tool_of(fields["tool"]), clock, options)
    return LocalSimulation(rig, PACES[fields["pace"]])
