"""Deviations of a simulated rig from its settings and drawings."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acquisition.simulation import PendantAction
from fakes.randomness import sound_rig_generator
from wam.model.constants import Array

# Standard deviations between sound rigs; ASSUMED.
ZEROS, STOPS, TILT, AXES = np.radians([0.3, 0.7, 0.3, 0.5]).tolist()
GAINS, MASS, CENTRE, CABLE = 0.005, 0.005, 1e-3, 0.08  # -, -, m, N


def _seven_zeros() -> Array:
    return np.zeros(7)


def _three_zeros() -> Array:
    return np.zeros(3)


def _identity_wiring() -> Array:
    return np.eye(7)


@dataclass(frozen=True, slots=True)
class ContainerError:
    """Error of the container's location in its row of the matrix.

    Attributes:
        incline: additional inclination [rad].
        far_end: shift of the far end [m].
        travel: additional length [m].
    """

    incline: float = 0.0
    far_end: tuple[float, float, float] = (0.0, 0.0, 0.0)
    travel: float = 0.0


@dataclass(frozen=True, slots=True)
class BusDefects:
    """Faults of the bus and foreign devices on it.

    Attributes:
        late_ns: delays of the position replies by node: (node, ns), ...
        lost: share of lost position replies.
        doubled: node that exists twice; 0 = none.
        other_master: node of another program that drives the arm; 0 = none.
        silent: nodes that send nothing.
    """

    late_ns: tuple[tuple[int, int], ...] = ()
    lost: float = 0.0
    doubled: int = 0
    other_master: int = 0
    silent: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class ModuleDefects:
    """Faults of the safety module and its pendant.

    Attributes:
        limits: ratio of a stored limit to the value set: (name, factor), ...
        dead_button: a pendant button without effect; None = none.
        is_disobedient: the module ignores a host that lowers its mode.
        heartbeat: factor on the heartbeat timeout.
    """

    limits: tuple[tuple[str, float], ...] = ()
    dead_button: PendantAction | None = None
    is_disobedient: bool = False
    heartbeat: float = 1.0


@dataclass(frozen=True, slots=True)
class RigDeviation:
    """Deviation of the true rig from its settings and drawings; none by default.

    Attributes:
        zeros: offsets of the joint zeros, reported minus true angle [rad], shape (7,).
        stops: shifts of the lower and the upper stops [rad], shape (2, 7).
        ratios: factors on the gear ratios of the joints, shape (7,).
        mount: rotations of the base about x, then y, then z [rad], shape (3,).
        links: additional mass of the links [kg], shape (7,).
        foot_mass: factor on the mass of the foot.
        foot_centre: shift of the foot's centre of mass [m], frame 7, shape (3,).
        sole: shift of the sole [m], frame 7, shape (3,).
        shown: matrix from the sensor's load to its reading, shape (6, 6).
        force_late: delay of the sensor's reading [s].
        cable: force of the sensor's cable on the foot [N], base frame, shape (3,).
        torque: matrix from commanded to true motor torques, shape (7, 7).
        counts: matrix from true to reported motor travel from home, shape (7, 7).
        torn: motor whose cable to the joints is torn, 1-7; 0 = none.
        friction: factor on the friction of the joints.
        properties: changed properties of pucks: (node, name, value), ...
        versions: changed firmware of pucks: (node, VERS), ...
        module: faults of the safety module.
        bus: faults of the bus.
        place: error of the container's location.
        typed_foot_mass: mistyped mass of the foot in rig.toml [kg]; None = correct.
    """

    zeros: Array = field(default_factory=_seven_zeros)
    stops: Array = field(default_factory=lambda: np.zeros((2, 7)))
    ratios: Array = field(default_factory=lambda: np.ones(7))
    mount: Array = field(default_factory=_three_zeros)
    links: Array = field(default_factory=_seven_zeros)
    foot_mass: float = 1.0
    foot_centre: Array = field(default_factory=_three_zeros)
    sole: Array = field(default_factory=_three_zeros)
    shown: Array = field(default_factory=lambda: np.eye(6))
    force_late: float = 0.0
    cable: Array = field(default_factory=_three_zeros)
    torque: Array = field(default_factory=_identity_wiring)
    counts: Array = field(default_factory=_identity_wiring)
    torn: int = 0
    friction: float = 1.0
    properties: tuple[tuple[int, str, int], ...] = ()
    versions: tuple[tuple[int, int], ...] = ()
    module: ModuleDefects = ModuleDefects()
    bus: BusDefects = BusDefects()
    place: ContainerError = ContainerError()
    typed_foot_mass: float | None = None

    def on(self, sound: "RigDeviation") -> "RigDeviation":
        """Return the combination of the deviation `sound` and this one."""
        return replace(
            self,
            zeros=sound.zeros + self.zeros,
            stops=sound.stops + self.stops,
            ratios=sound.ratios * self.ratios,
            mount=sound.mount + self.mount,
            links=sound.links + self.links,
            foot_mass=sound.foot_mass * self.foot_mass,
            foot_centre=sound.foot_centre + self.foot_centre,
            sole=sound.sole + self.sole,
            shown=self.shown.dot(sound.shown),
            cable=sound.cable + self.cable,
            friction=sound.friction * self.friction,
        )


def rotation(angles: Sequence[float]) -> Array:
    """Return the rotation about x, then y, then z by `angles` [rad], shape (3, 3)."""
    a, b, c = np.cos(angles).tolist()
    i, j, k = np.sin(angles).tolist()
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, a, -i], [0.0, i, a]])
    about_y = np.array([[b, 0.0, j], [0.0, 1.0, 0.0], [-j, 0.0, b]])
    about_z = np.array([[c, -k, 0.0], [k, c, 0.0], [0.0, 0.0, 1.0]])
    return about_z @ about_y @ about_x


def rotated_axes(angles: Sequence[float]) -> Array:
    """Return the reading matrix of a sensor rotated by `angles` [rad], shape (6, 6)."""
    matrix, to_sensor = np.zeros((6, 6)), rotation(angles).T
    matrix[:3, :3] = matrix[3:, 3:] = to_sensor
    return matrix


def draw_sound_rig(seed: int) -> RigDeviation:
    """Return the deviation of the sound rig of `seed` from its drawings.

    A separate generator is used, so no other random quantity of the rig changes.
    """
    generator = sound_rig_generator(seed)

    def drawn(scale: float, *shape: int) -> Array:
        return scale * generator.standard_normal(shape)

    zeros, stops = drawn(ZEROS, 7), drawn(STOPS, 2, 7)
    tilt, axes = drawn(TILT, 2), drawn(AXES, 3)
    gains, mass = 1.0 + drawn(GAINS, 6), 1.0 + float(drawn(MASS, 1)[0])
    centre, cable = drawn(CENTRE, 3), drawn(CABLE, 3)
    return RigDeviation(
        zeros=zeros,
        stops=stops,
        mount=np.append(tilt, 0.0),
        shown=gains[:, None] * rotated_axes(axes.tolist()),
        foot_mass=mass,
        foot_centre=centre,
        cable=cable,
    )
