# pyright: basic, reportMissingImports=false
"""Rigid-body model of the simulated arm: links, sensor, foot, person's forearm."""

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

FOREARM_MASS = 1.0  # of the person's arm, supported by the person [kg]
_HAND_ABOVE_PLATE = 0.030  # on the axis of joint 7 [m]


class Support(Enum):
    """Support of an arm without motor torques, other than the operator's hand.

    STAND: a stand at the initial pose. PERSON: a person, at any pose, while no motor
    has torque. NONE: none; the arm sinks on its shorted windings.
    """

    STAND = auto()
    PERSON = auto()
    NONE = auto()


@dataclass(frozen=True, slots=True)
class PlantOptions:
    """Deviations of the simulated arm from an ideal one.

    Attributes:
        friction: factor of the joint friction identified on another arm. That of a real
            arm is unknown; above 0.1 slips hardly bounce back.
        substeps: steps per 2 ms cycle.
        seed: seed of the friction parameters; None = nominal ones.
        motors: friction of the motors; None = drawn.
        cables: resonance of the joints on their cables [Hz]; None = stiff cables.
        has_hand: a person holds the arm by its forearm from the start.
        windings: factor of the shorted windings' damping by the motors' data sheet;
            also drawn with `seed`.
        support: support of the arm without motor torques.
        down: direction of gravity in the base frame.
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
        model: model whose world frame is the terrain frame.
        sole: index of the sole's frame.
        hand: index of the frame at which a person holds the forearm.
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
    """Return a model of the arm in the terrain frame.

    The hand is on link 6, where a person holds the forearm, with a mass of `forearm`
    [kg], 0 without a person. Gravity points `down` in the base frame.
    """
    model = build_pinocchio(constants, (tool.sensor, tool.foot))
    _move_to_terrain_frame(model, frame, down)
    hand = _add_forearm(model, constants, forearm)
    sole = add_point(model, constants, "sole", tool.sole)
    return ArmAndHand(model, sole, hand)


def motor_inertia(model: "pin.Model", constants: ArmConstants, q: Array) -> Array:
    """Return the effective inertia at each motor, other motors free [kg m^2], (7,).

    Args:
        model: the arm; its armature is set to the drive inertia.
        constants: constants of the arm.
        q: joint positions [rad], shape (7,).
    """
    model.armature = np.diag(drive_inertia_matrix(constants))
    upper = np.triu(pin.computeMinverse(model, model.createData(), q))
    inverse = upper + np.triu(upper, 1).T
    return 1.0 / np.einsum("ij,jk,ik->i", constants.j2mp, inverse, constants.j2mp)


def cable_inertia(model: "pin.Model", constants: ArmConstants, q: Array) -> Array:
    """Return the link inertia on the cable of each motor [kg m^2], shape (7,).

    For the heaviest joint of the motor, with the other joints held, divided among its
    motors. The two cables of a differential get the same value.

    Args:
        model: the arm; its armature is set to 0.
        constants: constants of the arm.
        q: joint positions [rad], shape (7,).
    """
    model.armature = np.zeros(7)
    joints = np.diag(pin.crba(model, model.createData(), q))
    ratios = constants.j2mp**2
    shared = joints / ratios.sum(axis=0)
    return np.where(ratios > 0.0, shared, 0.0).max(axis=1)


def motor_weights(model: "pin.Model", constants: ArmConstants, q: Array) -> Array:
    """Return the magnitude of the gravity torque on each motor [N m], shape (7,)."""
    weight = pin.computeGeneralizedGravity(model, model.createData(), q)
    return np.abs(np.linalg.solve(constants.j2mp.T, weight))


def _move_to_terrain_frame(
    model: "pin.Model", frame: TerrainFrame, down: tuple[float, float, float]
) -> None:
    """Make the terrain frame the world frame of the model."""
    axes = frame.axes()
    base = pin.SE3(axes, -axes.dot(frame.start))
    model.jointPlacements[1] = base * model.jointPlacements[1]
    gravity = np.linalg.norm(model.gravity.linear)
    model.gravity.linear = axes.dot(np.array(down) / np.linalg.norm(down)) * gravity


def _add_forearm(model: "pin.Model", constants: ArmConstants, mass: float) -> int:
    """Add the hand's frame on link 6 with the mass of a forearm [kg]."""
    alpha, height = constants.alpha[5], constants.d[6] - _HAND_ABOVE_PLATE
    c, s = np.cos(alpha), np.sin(alpha)
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    link = pin.SE3(tilt, np.array([constants.a[5], 0.0, constants.d[5]]))
    placement = link * pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
    hand = model.addFrame(pin.Frame("hand", 6, 0, placement, pin.FrameType.OP_FRAME))
    arm = pin.Inertia(mass, np.zeros(3), np.zeros((3, 3)))
    model.appendBodyToJoint(6, placement.act(arm), pin.SE3.Identity())
    return hand
