"""How a simulated rig differs from what its settings and drawings say of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acquisition.simulation import PendantAction
from fakes.randomness import sound_rig_generator
from wam.model.constants import Array

# Standard deviations between sound rigs; ASSUMED.
ZEROS, STOPS, TILT, AXES = np.radians([0.3, 0.7, 0.3, 0.5]).tolist()
GAINS, MASS, CENTRE, CABLE = 0.005, 0.005, 1e-3, 0.08  # 1, 1, m, N


def _no_angles() -> Array:
    return np.zeros(7)


def _no_vector() -> Array:
    return np.zeros(3)


def _as_wired() -> Array:
    return np.eye(7)


@dataclass(frozen=True, slots=True)
class Place:
    """Where the container truly is, against its row of the matrix.

    Attributes:
        incline: further inclined [rad].
        far_end: further away [m].
        travel: longer [m].
    """

    incline: float = 0.0
    far_end: tuple[float, float, float] = (0.0, 0.0, 0.0)
    travel: float = 0.0


@dataclass(frozen=True, slots=True)
class BusTrouble:
    """What is wrong with the bus and who is on it.

    Attributes:
        late_ns: by which the position replies of a node come too late: (node, ns), ...
        lost: share of the position replies that is lost.
        doubled: node that is there twice; 0 = none.
        other_master: node of another program that drives the arm; 0 = none.
        silent: nodes that say nothing.
    """

    late_ns: tuple[tuple[int, int], ...] = ()
    lost: float = 0.0
    doubled: int = 0
    other_master: int = 0
    silent: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class ModuleTrouble:
    """What is wrong with the safety module and its pendant.

    Attributes:
        limits: factor by which it sets another limit than it was told: (name, factor).
        dead_button: of the pendant that does nothing; None = none.
        is_disobedient: it ignores a host that lowers its mode.
        heartbeat: how long it waits for positions, as a multiple.
    """

    limits: tuple[tuple[str, float], ...] = ()
    dead_button: PendantAction | None = None
    is_disobedient: bool = False
    heartbeat: float = 1.0


@dataclass(frozen=True, slots=True)
class Departure:
    """What is true of a rig, against what is believed; nothing by default.

    Attributes:
        zeros: angles that positions show too much [rad], shape (7,).
        stops: how much further up the lower and the upper stops are [rad], (2, 7).
        ratios: true gear ratios of the joints, as shares, shape (7,).
        mount: turns of the base about x, then y, then z [rad], shape (3,).
        links: more mass in the links [kg], shape (7,).
        foot_mass: true mass of the foot, as a share.
        foot_centre: how far its centre is off [m], frame 7, shape (3,).
        sole: how far the sole is off [m], frame 7, shape (3,).
        shown: what the sensor shows of the load on it, shape (6, 6).
        force_late: age of what it shows [s].
        cable: force of its cable on the foot [N], base frame, shape (3,).
        torque: what each motor makes of each torque that is sent, shape (7, 7).
        counts: what each encoder tells of each motor's way from home, shape (7, 7).
        torn: motor whose cable to the joints is torn, 1-7; 0 = none.
        friction: of the joints, as a share.
        properties: that pucks have otherwise: (node, name, value), ...
        versions: firmware that pucks have otherwise: (node, VERS), ...
        module: trouble of the safety module.
        bus: trouble of the bus.
        place: of the container.
        foot_typed: mass of the foot that is typed into rig.toml [kg]; None = as it is.
    """

    zeros: Array = field(default_factory=_no_angles)
    stops: Array = field(default_factory=lambda: np.zeros((2, 7)))
    ratios: Array = field(default_factory=lambda: np.ones(7))
    mount: Array = field(default_factory=_no_vector)
    links: Array = field(default_factory=_no_angles)
    foot_mass: float = 1.0
    foot_centre: Array = field(default_factory=_no_vector)
    sole: Array = field(default_factory=_no_vector)
    shown: Array = field(default_factory=lambda: np.eye(6))
    force_late: float = 0.0
    cable: Array = field(default_factory=_no_vector)
    torque: Array = field(default_factory=_as_wired)
    counts: Array = field(default_factory=_as_wired)
    torn: int = 0
    friction: float = 1.0
    properties: tuple[tuple[int, str, int], ...] = ()
    versions: tuple[tuple[int, int], ...] = ()
    module: ModuleTrouble = ModuleTrouble()
    bus: BusTrouble = BusTrouble()
    place: Place = Place()
    foot_typed: float | None = None

    def on(self, sound: "Departure") -> "Departure":
        """Return what is true of a rig that departs like `sound` and like this too."""
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
    """Return the matrix of turns about x, then y, then z by `angles` [rad], (3, 3)."""
    a, b, c = np.cos(angles).tolist()
    i, j, k = np.sin(angles).tolist()
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, a, -i], [0.0, i, a]])
    about_y = np.array([[b, 0.0, j], [0.0, 1.0, 0.0], [-j, 0.0, b]])
    about_z = np.array([[c, -k, 0.0], [k, c, 0.0], [0.0, 0.0, 1.0]])
    return about_z @ about_y @ about_x


def turned_axes(angles: Sequence[float]) -> Array:
    """Return what a sensor shows whose axes are turned by `angles` [rad], (6, 6)."""
    shown, turn = np.zeros((6, 6)), rotation(angles).T
    shown[:3, :3] = shown[3:, 3:] = turn
    return shown


def draw_sound(seed: int) -> Departure:
    """Return how the sound rig of `seed` differs from its drawings.

    What it draws from is its own: nothing else that is random in a rig changes.
    """
    random = sound_rig_generator(seed)

    def drawn(scale: float, *shape: int) -> Array:
        return scale * random.standard_normal(shape)

    zeros, stops = drawn(ZEROS, 7), drawn(STOPS, 2, 7)
    tilt, axes = drawn(TILT, 2), drawn(AXES, 3)
    gains, mass = 1.0 + drawn(GAINS, 6), 1.0 + float(drawn(MASS, 1)[0])
    centre, cable = drawn(CENTRE, 3), drawn(CABLE, 3)
    return Departure(
        zeros=zeros,
        stops=stops,
        mount=np.append(tilt, 0.0),
        shown=gains[:, None] * turned_axes(axes.tolist()),
        foot_mass=mass,
        foot_centre=centre,
        cable=cable,
    )
