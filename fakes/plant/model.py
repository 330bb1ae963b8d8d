# pyright: basic, reportMissingImports=false
"""The body that the simulated arm is: links, sensor, foot and a person's forearm."""

from dataclasses import dataclass
from enum import Enum, auto
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ft_sensor.payload import TerrainFrame
from wam.model.arm_model import add_point, build_pinocchio, drive_inertia_matrix
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction
from wam.model.tool import Tool

FOREARM_MASS = 1.0  # of the person's arm, carried by the person [kg]
_HAND_ABOVE_PLATE = 0.030  # on the axis of joint 7 [m]


class Support(Enum):
    """What bears an arm that no motor drives, apart from a hand that is on it.

    STAND: a stand, where the arm begins. PERSON: a person, wherever the arm is, as long
    as no motor pulls. NONE: nothing; it sinks on its shorted windings.
    """

    STAND = auto()
    PERSON = auto()
    NONE = auto()


@dataclass(frozen=True, slots=True)
class PlantOptions:
    """How the simulated arm differs from an ideal one.

    Attributes:
        friction: share of the joint friction identified on another arm (1 = all of
            it). A real arm's is unknown; with more than 0.1 hardly a slip bounces.
        substeps: steps per 2 ms cycle.
        seed: draws the parameters of friction; None = the nominal ones.
        motors: friction of the motors, given instead of drawn; None = drawn.
        cables: resonance of the joints on their cables [Hz]; None = stiff cables.
        has_hand: a person holds the arm by its forearm, from the beginning.
        windings: share of the damping that shorted windings have by the motors' data;
            it is drawn anew with `seed`.
        support: what bears the arm while no motor drives it.
        down: where its base is mounted, the direction of gravity in the base frame.
    """

    friction: float = 0.02
    substeps: int = 4
    seed: int | None = None
    motors: MotorFriction | None = None
    cables: float | None = None
    has_hand: bool = True
    windings: float = 1.0
    support: Support = Support.STAND
    down: tuple[float, float, float] = (0.0, 0.0, -1.0)


class ArmAndHand(NamedTuple):
    """A model of the arm with the hand on it.

    Attributes:
        model: its world is the terrain frame.
        sole: number of the sole's frame.
        hand: number of the frame where a person holds the forearm.
    """

    model: "pin.Model"
    sole: int
    hand: int


def arm_and_hand(
    constants: ArmConstants,
    tool: Tool,
    frame: TerrainFrame,
    forearm: float = FOREARM_MASS,
    down: tuple[float, float, float] = (0.0, 0.0, -1.0),
) -> ArmAndHand:
    """Return a model of the arm that stands before the terrain.

    The hand is on link 6, where a person holds the forearm, and has the mass of one:
    `forearm` [kg], 0 where there is no person. Gravity points `down` in the base frame.
    """
    model = build_pinocchio(constants, (tool.sensor, tool.foot))
    _stand_in(model, frame, down)
    hand = _add_forearm(model, constants, forearm)
    sole = add_point(model, constants, "sole", tool.sole)
    return ArmAndHand(model, sole, hand)


def motor_inertia(model: "pin.Model", constants: ArmConstants, q: Array) -> Array:
    """Return what each motor moves when it turns alone [kg m^2], shape (7,).

    Args:
        model: the arm; gets the inertia of its drives.
        constants: of the arm.
        q: joint positions [rad], shape (7,).
    """
    model.armature = np.diag(drive_inertia_matrix(constants))
    upper = np.triu(pin.computeMinverse(model, model.createData(), q))
    inverse = upper + np.triu(upper, 1).T
    return 1.0 / np.einsum("ij,jk,ik->i", constants.j2mp, inverse, constants.j2mp)


def cable_inertia(model: "pin.Model", constants: ArmConstants, q: Array) -> Array:
    """Return what swings on the cable of each motor [kg m^2], shape (7,).

    Of the heaviest joint that the motor turns, the others held still, its share by
    motors that turn it. The two cables of a differential are alike.

    Args:
        model: the arm; loses the inertia of its drives.
        constants: of the arm.
        q: joint positions [rad], shape (7,).
    """
    model.armature = np.zeros(7)
    joints = np.diag(pin.crba(model, model.createData(), q))
    ratios = constants.j2mp**2
    shared = joints / ratios.sum(axis=0)
    return np.where(ratios > 0.0, shared, 0.0).max(axis=1)


def motor_weights(model: "pin.Model", constants: ArmConstants, q: Array) -> Array:
    """Return what the weight puts on each motor, without sign [N m], shape (7,)."""
    weight = pin.computeGeneralizedGravity(model, model.createData(), q)
    return np.abs(np.linalg.solve(constants.j2mp.T, weight))


def _stand_in(
    model: "pin.Model", frame: TerrainFrame, down: tuple[float, float, float]
) -> None:
    """Let the terrain frame be the world of the model: nothing is to be turned."""
    axes = frame.axes()
    base = pin.SE3(axes, -axes.dot(frame.far_end))
    model.jointPlacements[1] = base * model.jointPlacements[1]
    gravity = np.linalg.norm(model.gravity.linear)
    model.gravity.linear = axes.dot(np.array(down) / np.linalg.norm(down)) * gravity


def _add_forearm(model: "pin.Model", constants: ArmConstants, mass: float) -> int:
    """Add the hand's frame on link 6 and the mass [kg] of a forearm in it."""
    alpha, height = constants.alpha[5], constants.d[6] - _HAND_ABOVE_PLATE
    c, s = np.cos(alpha), np.sin(alpha)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    link = pin.SE3(tilt, np.array([constants.a[5], 0.0, constants.d[5]]))
    placement = link * pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
    hand = model.addFrame(pin.Frame("hand", 6, 0, placement, pin.FrameType.OP_FRAME))
    arm = pin.Inertia(mass, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(6, placement.act(arm), pin.SE3.Identity())
    return hand
