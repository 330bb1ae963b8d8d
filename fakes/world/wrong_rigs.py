"""The catalogue of wrong rigs: what may be wrong with a rig that is taken for sound.

Each is a line of data: what is wrong, why that happens, and the steps of commissioning
that find it, the first of them first. They are applied at the truth: arm, cables,
sensor, pucks, bus, container; only what is mistyped is applied to the settings.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from enum import Enum
from functools import lru_cache

import numpy as np

from acquisition.errors import SettingsError
from fakes.world.departure import (
    BusTrouble,
    Departure,
    ModuleTrouble,
    Place,
    turned_axes,
)
from wam.bus.frames import MOTOR_NODES
from wam.model.constants import Array

_MS = 1_000_000  # ns
_A_CYCLE, _TWO_CYCLES = 2 * _MS, 3_950_000  # of replies that are late for ever [ns]
_OTHER, _POLLER = 20, 21  # nodes of other programs
_LBF, _KGF, _LBF_IN = 0.22481, 0.10197, 8.8507  # per N, N, N m
_OTHER_GEARS = 9.48 / 9.7  # of the wrist of another generation
_POUND_FOOT = 4.5  # kg typed for 0.45


class Class(Enum):
    """What kind of thing is wrong."""

    IDENTITY = "identity"
    WIRING = "wiring"
    GEOMETRY = "geometry"
    TOOL = "tool"
    SENSOR = "sensor"
    BUS = "bus, time"
    MECHANICS = "mechanics"
    STOP = "stop, limits"
    PLACE = "place"


@dataclass(frozen=True, slots=True)
class WrongRig:
    """A rig that is not what it is taken for.

    Attributes:
        name: it is called by.
        number: of its row in the catalogue.
        kind: what kind of thing is wrong.
        wrong: what is wrong, in words.
        cause: how that may come about.
        steps: of commissioning that find it, the first one first; () = it is missed.
        departure: how it differs from what is believed.
    """

    name: str
    number: int
    kind: Class
    wrong: str
    cause: str
    steps: tuple[str, ...]
    departure: Departure = field(default_factory=Departure)


def scaled(**motors: float) -> Array:
    """Return the matrix of motors that make a share of it, e.g. `m2=0.5`, (7, 7)."""
    matrix = np.eye(7)
    for name, share in motors.items():
        matrix[int(name[1:]) - 1] *= share
    return matrix


def swapped(a: int, b: int) -> Array:
    """Return the matrix of two cables that are swapped, 1-7, shape (7, 7)."""
    matrix = np.eye(7)
    matrix[[a - 1, b - 1]] = matrix[[b - 1, a - 1]]
    return matrix


def _reversed(*numbers: int) -> Array:
    return scaled(**{f"m{number}": -1.0 for number in numbers})


def _joints(**degrees: float) -> Array:
    """Return joint angles [rad] of which some are not 0, e.g. `j2=10`, shape (7,)."""
    angles = np.zeros(7)
    for name, angle in degrees.items():
        angles[int(name[1:]) - 1] = np.radians(angle)
    return angles


def _turned(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Array:
    """Return what a sensor shows whose axes are turned [degrees], shape (6, 6)."""
    return turned_axes(np.radians([x, y, z]).tolist())


def _shown(force: float = 1.0, torque: float = 1.0) -> Array:
    return np.diag([force] * 3 + [torque] * 3)


def _axes(*order: int) -> Array:
    """Return what a sensor shows whose axes come in another order, shape (6, 6)."""
    return np.eye(6)[[*order, *(3 + axis for axis in order)]]


def _foreign_matrix() -> Array:
    """Return a calibration of one sensor times the inverse of another one's, (6, 6)."""
    units = np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05])  # of loads alike: N, N m
    mixed = 0.12 * np.random.default_rng(51).standard_normal((6, 6))
    return np.eye(6) + mixed * units[:, None] / units


def _late(late_ns: int, nodes: Sequence[int] = MOTOR_NODES) -> Departure:
    return Departure(bus=BusTrouble(late_ns=tuple((node, late_ns) for node in nodes)))


def _said(*properties: tuple[int, str, int]) -> Departure:
    return Departure(properties=properties)


def _of_all(name: str, value: int) -> Departure:
    return _said(*((node, name, value) for node in MOTOR_NODES))


def _swap_motors(a: int, b: int) -> Departure:
    return Departure(torque=swapped(a, b))


def _swap_encoders(a: int, b: int) -> Departure:
    return Departure(counts=swapped(a, b))


def _mounted(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Departure:
    return Departure(mount=np.radians([x, y, z]))


def _zero(**degrees: float) -> Departure:
    return Departure(zeros=_joints(**degrees))


def _senses(shown: Array) -> Departure:
    return Departure(shown=shown)


_I, _W, _G, _T = Class.IDENTITY, Class.WIRING, Class.GEOMETRY, Class.TOOL
_S, _B, _M, _E, _P = (
    Class.SENSOR,
    Class.BUS,
    Class.MECHANICS,
    Class.STOP,
    Class.PLACE,
)
# fmt: off
_IDENTITY = (
    WrongRig("pidx-3-is-2", 1, _I, "puck 3 takes the torque of puck 2 (PIDX 2)", "spare puck", ("C2", "C9"), _said((3, "PIDX", 2))),
    WrongRig("pidx-2-is-1", 1, _I, "puck 2 takes the torque of puck 1 (PIDX 1)", "spare puck", ("C2", "C9"), _said((2, "PIDX", 1))),
    WrongRig("pidx-6-is-1", 2, _I, "puck 6 takes the torque of puck 5 (PIDX 1)", "spare puck", ("C2", "C9"), _said((6, "PIDX", 1))),
    WrongRig("grpb-3-is-2", 3, _I, "puck 3 listens to the wrist's torques (GRPB 2)", "wrist puck in the arm", ("C2", "C9"), _said((3, "GRPB", 2))),
    WrongRig("mt-700", 4, _I, "pucks 2 and 3 clip torques at MT 700", "configuration lost", ("C2", "C9"), _said((2, "MT", 700), (3, "MT", 700))),
    WrongRig("mt-400", 4, _I, "puck 2 clips torques at MT 400", "configuration lost", ("C2", "C9"), _said((2, "MT", 400))),
    WrongRig("mt-0", 4, _I, "puck 4 makes no torque (MT 0)", "configuration lost", ("C2", "C9"), _said((4, "MT", 0))),
    WrongRig("mt-7-is-4860", 5, _I, "puck 7 lets through the torque of a shoulder (MT 4860)", "default of the firmware", ("C2",), _said((7, "MT", 4860))),
    WrongRig("ipnm-2-tenth", 6, _I, "puck 2 states a tenth of its torque scale (IPNM 270)", "service tool", ("C2", "C9"), _said((2, "IPNM", 270))),
    WrongRig("ipnm-2-tenfold", 6, _I, "puck 2 states ten times its torque scale (IPNM 27000)", "service tool", ("C2", "C9"), _said((2, "IPNM", 27000))),
    WrongRig("ipnm-2-double", 6, _I, "puck 2 states twice its torque scale (IPNM 5400)", "service tool", ("C2", "C9"), _said((2, "IPNM", 5400))),
    WrongRig("ipnm-7-is-2700", 6, _I, "puck 7 states the torque scale of a shoulder (IPNM 2700)", "service tool", ("C2", "C9"), _said((7, "IPNM", 2700))),
    WrongRig("wrist-puck-in-shoulder", 7, _I, "puck 2 is one of a wrist: IPNM 6500, POLES 8, MT 3900", "spare part", ("C2",), _said((2, "IPNM", 6500), (2, "POLES", 8), (2, "MT", 3900))),
    WrongRig("cts-2-is-8192", 8, _I, "puck 2 states twice its counts per turn (CTS 8192)", "setting", ("C2", "C5"), _said((2, "CTS", 8192))),
    WrongRig("cts-4-is-40960", 9, _I, "puck 4 states ten times its counts per turn", "optical encoder", ("C2", "C5"), _said((4, "CTS", 40960))),
    WrongRig("cts-tenfold", 10, _I, "all pucks state ten times their counts per turn", "property of an old arm", ("C5",), _of_all("CTS", 40960)),
    WrongRig("id-4-is-5", 11, _I, "puck 4 says that it is node 5", "renumbered", ("C2",), _said((4, "ID", 5))),
    WrongRig("poles-4-is-8", 12, _I, "puck 4 states 8 poles of 12", "type of motor", ("C2",), _said((4, "POLES", 8))),
    WrongRig("mixed-firmware", 13, _I, "puck 3 has firmware 60, in which properties have other numbers", "repair", ("C2",), Departure(versions=((3, 60),))),
    WrongRig("another-arm", 14, _I, "it is another arm: seven other serial numbers", "second WAM, same files", ("C2",), _said(*((node, "SN", 2000 + node) for node in MOTOR_NODES))),
    WrongRig("one-puck-replaced", 15, _I, "puck 3 has another serial number", "repair", ("C2",), _said((3, "SN", 2003))),
    WrongRig("four-joints", 16, _I, "pucks 5, 6 and 7 are not there", "wrist removed", ("C1", "C2"), Departure(bus=BusTrouble(silent=(5, 6, 7)))),
    WrongRig("puck-4-silent", 16, _I, "puck 4 says nothing", "transmit wire", ("C1", "C2"), Departure(bus=BusTrouble(silent=(4,)))),
    WrongRig("otemp-120", 17, _I, "puck 2 becomes 120 degrees warm before it stops", "service", ("C2",), _said((2, "OTEMP", 120))),
)
_WIRING = (
    *(WrongRig(f"motor-{k}-reversed", 18, _W, f"motor {k} turns the other way", "plug turned", ("C9",), Departure(torque=_reversed(k))) for k in MOTOR_NODES),
    WrongRig("motors-2-3-swapped", 19, _W, "cables of motors 2 and 3 are swapped", "loom", ("C9",), _swap_motors(2, 3)),
    WrongRig("motors-5-6-swapped", 20, _W, "cables of motors 5 and 6 are swapped", "loom", ("C9",), _swap_motors(5, 6)),
    WrongRig("motors-1-4-swapped", 21, _W, "cables of motors 1 and 4 are swapped", "loom", ("C9",), _swap_motors(1, 4)),
    WrongRig("motors-2-3-reversed", 22, _W, "motors 2 and 3 both turn the other way", "loom", ("C9",), Departure(torque=_reversed(2, 3))),
    *(WrongRig(f"encoder-{k}-reversed", 23, _W, f"the encoder of motor {k} counts the other way", "wiring", ("C5",), Departure(counts=_reversed(k))) for k in MOTOR_NODES),
    WrongRig("encoders-2-3-swapped", 24, _W, "encoders of motors 2 and 3 are swapped", "loom", ("C5", "C6"), _swap_encoders(2, 3)),
    WrongRig("encoders-5-6-swapped", 24, _W, "encoders of motors 5 and 6 are swapped", "loom", ("C5", "C6"), _swap_encoders(5, 6)),
    WrongRig("encoders-1-4-swapped", 25, _W, "encoders of motors 1 and 4 are swapped", "loom", ("C5",), _swap_encoders(1, 4)),
    WrongRig("encoders-6-7-swapped", 25, _W, "encoders of motors 6 and 7 are swapped", "loom", ("C5",), _swap_encoders(6, 7)),
    WrongRig("motor-2-dead", 26, _W, "motor 2 makes no torque, its puck answers", "open phase", ("C9",), Departure(torque=scaled(m2=0.0))),
    WrongRig("motor-4-dead", 26, _W, "motor 4 makes no torque, its puck answers", "open phase", ("C9",), Departure(torque=scaled(m4=0.0))),
    WrongRig("motor-2-weak", 26, _W, "motor 2 makes 70 % of its torque", "a phase with little contact", ("C9",), Departure(torque=scaled(m2=0.7))),
    WrongRig("motors-2-3-half", 26, _W, "motors 2 and 3 make half their torque", "open phases", ("C9",), Departure(torque=scaled(m2=0.5, m3=0.5))),
)
_GEOMETRY = (
    *(WrongRig(f"zero-{k}-off-3deg", 27, _G, f"the zero of joint {k} is 3 degrees off", "sloppy home", ("C7",), _zero(**{f"j{k}": 3.0})) for k in MOTOR_NODES),
    WrongRig("zero-2-off-10deg", 28, _G, "the zero of joint 2 is 10 degrees off", "home on a bolt", ("C5", "C6", "C7"), _zero(j2=-10.0)),
    WrongRig("zero-7-off-90deg", 29, _G, "the zero of joint 7 is 90 degrees off", "no stop felt", ("C5", "C6", "C7"), _zero(j7=90.0)),
    WrongRig("ratios-low", 30, _G, "gear ratios of joints 1 to 4 are 1.5 % lower", "diameter of the cables", ("C5",), Departure(ratios=np.array([0.985] * 4 + [1.0] * 3))),
    WrongRig("wrist-9.48", 31, _G, "gear ratios of joints 5 and 6 are 9.48, not 9.7", "wrist of another generation", ("C5",), Departure(ratios=np.array([1.0] * 4 + [_OTHER_GEARS] * 2 + [1.0]))),
    WrongRig("base-on-wall", 32, _G, "the base is mounted on a wall", "mounting", ("C6", "C8"), _mounted(x=-90.0)),
    WrongRig("base-on-ceiling", 33, _G, "the base is mounted on the ceiling", "mounting", ("C6", "C8"), _mounted(x=180.0)),
    WrongRig("base-tilted-5deg", 34, _G, "the base is tilted by 5 degrees", "table", ("C7",), _mounted(x=3.0, y=4.0)),
    WrongRig("base-tilted-2deg", 35, _G, "the base is tilted by 2 degrees", "table", (), _mounted(x=1.2, y=1.6)),
    WrongRig("base-turned-90deg", 36, _G, "the base is turned by 90 degrees about the vertical", "mounting", ("C13",), _mounted(z=90.0)),
)
_TOOL = (
    WrongRig("foot-typed-4.5kg", 37, _T, "the foot is typed as 4.5 kg, it has 0.45 kg", "decimal point", ("C0", "C6", "C9"), Departure(foot_typed=_POUND_FOOT)),
    WrongRig("foot-half", 38, _T, "the foot has half the mass that is typed", "another foot", ("C6",), Departure(foot_mass=0.5)),
    WrongRig("foot-heavier", 38, _T, "the foot has one and a half times the mass that is typed", "another foot", ("C6",), Departure(foot_mass=1.5)),
    WrongRig("foot-forgotten", 39, _T, "the foot is typed as 50 g, as if there were none", "rig.toml", ("C6", "C10"), Departure(foot_typed=0.05)),
    WrongRig("centre-off-50mm", 40, _T, "the centre of the foot is 50 mm aside", "drawing", ("C6",), Departure(foot_centre=np.array([0.0, 0.05, 0.0]))),
    WrongRig("sole-20mm-lower", 41, _T, "the sole is 20 mm lower", "another sole", ("C7",), Departure(sole=np.array([0.0, 0.0, 0.02]))),
)
_SENSOR = (
    WrongRig("sensor-turned-90deg", 42, _S, "the sensor is turned by 90 degrees about joint 7", "bolts", ("C6", "C7"), _senses(_turned(z=90.0))),
    WrongRig("sensor-turned-180deg", 42, _S, "the sensor is turned by 180 degrees about joint 7", "bolts", ("C6", "C7"), _senses(_turned(z=180.0))),
    WrongRig("sensor-turned-10deg", 43, _S, "the sensor is turned by 10 degrees about joint 7", "slot", ("C6", "C7"), _senses(_turned(z=10.0))),
    WrongRig("sensor-turned-20deg", 43, _S, "the sensor is turned by 20 degrees about joint 7", "slot", ("C6", "C7"), _senses(_turned(z=20.0))),
    WrongRig("sensor-tilted-10deg", 44, _S, "the sensor is tilted by 10 degrees", "chip under the flange", ("C6", "C7"), _senses(_turned(x=10.0))),
    WrongRig("sensor-axes-swapped", 45, _S, "x and y of the sensor are swapped", "convention", ("C6",), _senses(_axes(1, 0, 2))),
    WrongRig("sensor-axes-cycled", 45, _S, "x, y, z of the sensor are y, z, x", "convention", ("C6",), _senses(_axes(1, 2, 0))),
    WrongRig("sensor-sign", 46, _S, "the sensor shows the reaction", "convention", ("C6",), _senses(-np.eye(6))),
    WrongRig("sensor-sign-x", 46, _S, "x of the sensor has the other sign, forces and moments", "convention", ("C6",), _senses(np.diag([-1.0, 1.0, 1.0] * 2))),
    WrongRig("sensor-lbf", 47, _S, "forces are in pounds", "the vendor's tool", ("C6",), _senses(_shown(force=_LBF))),
    WrongRig("sensor-kgf", 47, _S, "forces are in kilograms", "the vendor's tool", ("C6",), _senses(_shown(force=_KGF))),
    WrongRig("sensor-nmm", 48, _S, "moments are in N mm", "the vendor's tool", ("C6",), _senses(_shown(torque=1000.0))),
    WrongRig("sensor-lbf-in", 48, _S, "moments are in pound inches", "the vendor's tool", ("C6",), _senses(_shown(torque=_LBF_IN))),
    WrongRig("sensor-scale-110", 49, _S, "the sensor shows 10 % too much", "another sheet", ("C7",), _senses(_shown(1.1, 1.1))),
    WrongRig("sensor-scale-95", 50, _S, "the sensor shows 5 % too little", "another sheet", ("C7", "C14"), _senses(_shown(0.95, 0.95))),
    WrongRig("sensor-foreign-matrix", 51, _S, "the matrix is that of another sensor", "files mixed up", ("C6", "C7"), _senses(_foreign_matrix())),
    WrongRig("sensor-cable-pulls", 52, _S, "the sensor's cable pulls at the foot with 1 N", "strain relief", ("C6",), Departure(cable=np.array([0.6, 0.8, 0.0]))),
    WrongRig("sensor-20ms-late", 53, _S, "forces are 20 ms old", "buffer", ("C12",), Departure(force_late=0.020)),
)
_BUS = (
    WrongRig("replies-a-cycle-late", 54, _B, "every position comes a cycle late", "adapter", ("C3",), _late(_A_CYCLE)),
    WrongRig("puck-7-late", 55, _B, "the positions of puck 7 come two cycles late", "congestion", ("C3",), _late(_TWO_CYCLES, (7,))),
    WrongRig("adapter-slow", 56, _B, "the adapter hands over every frame 2 ms late", "USB", ("C3",), Departure(bus=BusTrouble(lag_ns=_A_CYCLE))),
    WrongRig("frames-lost", 57, _B, "0.1 % of the positions are lost", "sample point", ("C3",), Departure(bus=BusTrouble(lost=0.001))),
    WrongRig("duplicate-node", 58, _B, "there are two pucks 5, both answer", "spare puck", ("C2",), Departure(bus=BusTrouble(doubled=5))),
    WrongRig("other-master", 59, _B, "another program drives the arm", "second program", ("C1",), Departure(bus=BusTrouble(other_master=_OTHER))),
    WrongRig("poller", 59, _B, "another program asks for positions", "second program", ("C1",), Departure(bus=BusTrouble(poller=_POLLER))),
)
_MECHANICS = (
    WrongRig("cable-2-torn", 60, _M, "the cable of motor 2 is off its drum", "broke", ("C5", "C9"), Departure(torn=2)),
    WrongRig("cable-4-torn", 60, _M, "the cable of motor 4 is off its drum", "broke", ("C5", "C9"), Departure(torn=4)),
    WrongRig("tendon-4-slipped", 61, _M, "the cable of motor 4 has slipped by 5 degrees of the joint", "slack", ("C5", "C7"), _zero(j4=5.0)),
    WrongRig("friction-threefold", 62, _M, "the joints rub three times as much", "pulley", ("C9",), Departure(friction=3.0)),
    WrongRig("torque-15-weak", 62, _M, "motors 2 and 3 make 85 % of their torque", "magnets", ("C10",), Departure(torque=scaled(m2=0.85, m3=0.85))),
)
_STOP = (
    WrongRig("stop-button-dead", 63, _E, "the stop button does nothing", "loom", ("C4",), Departure(module=ModuleTrouble(dead_button="estop"))),
    WrongRig("module-disobeys", 64, _E, "the safety module ignores a program that wants it idle", "firmware", ("C4",), Departure(module=ModuleTrouble(is_disobedient=True))),
    WrongRig("vl2-doubled", 64, _E, "the safety module sets twice the speed limit it is told", "firmware", ("C2", "C4"), Departure(module=ModuleTrouble(limits=(("VL2", 2.0),)))),
)
_PLACE = (
    WrongRig("incline-off-5deg", 65, _P, "the container is inclined by 5 degrees more than typed", "typing", ("C13",), Departure(place=Place(incline=float(np.radians(5.0))))),
    WrongRig("incline-other-way", 65, _P, "the container is inclined the other way; level ones are not wrong", "sign", ("C13",), Departure(place=Place(is_other_way=True))),
    WrongRig("heading-off-20deg", 65, _P, "the container is turned by 20 degrees", "typing", ("C13",), Departure(place=Place(heading=float(np.radians(20.0))))),
    WrongRig("far-end-off-100mm", 65, _P, "the far end is 100 mm lower than typed", "typing", ("C13",), Departure(place=Place(far_end=(0.0, 0.0, -0.1)))),
    WrongRig("travel-too-long", 66, _P, "the container is 100 mm shorter than typed", "typing", ("C13",), Departure(place=Place(travel=-0.1))),
    WrongRig("label-swapped", 66, _P, "the container is a plate, or has stones where a plate is typed", "label", ("C14",), Departure(place=Place(is_relabelled=True))),
)
_OTHERS = (
    WrongRig("joint-1-blocked", 67, _G, "joint 1 meets a bracket 20 degrees before its upper stop", "cable bracket", ("C5",), Departure(stops=np.stack([np.zeros(7), _joints(j1=-20.0)]))),
    WrongRig("encoder-4-loses-counts", 68, _W, "the encoder of motor 4 loses one count in twenty", "loose magnet", ("C5",), Departure(counts=scaled(m4=0.95))),
    WrongRig("pucks-1-4-exchanged", 69, _W, "pucks 1 and 4 sit at each other's motor", "repair", ("C5",), Departure(torque=swapped(1, 4), counts=swapped(1, 4))),
    WrongRig("foot-turned-180deg", 70, _T, "the foot is mounted turned by 180 degrees", "bolts", ("C6", "C7"), Departure(is_foot_turned=True)),
    WrongRig("load-on-elbow", 71, _M, "a camera of 1 kg is strapped to link 3", "another experiment", ("C10",), Departure(links=np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))),
    WrongRig("sensor-moments-first", 72, _S, "the sensor sends moments before forces", "another firmware", ("C6",), _senses(np.roll(np.eye(6), 3, axis=0))),
    WrongRig("sensor-x-dead", 73, _S, "the sensor shows no force along x", "bridge open", ("C6", "C7"), _senses(np.diag([0.0, 1.0, 1.0, 1.0, 1.0, 1.0]))),
    WrongRig("idle-button-dead", 74, _E, "Shift-idle of the pendant does nothing", "contact", ("C4",), Departure(module=ModuleTrouble(dead_button="idle"))),
    WrongRig("supply-40v", 75, _E, "the power bus has 40 V", "another supply", ("C2",), Departure(module=ModuleTrouble(voltage=40.0))),
    WrongRig("puck-6-hot", 76, _M, "puck 6 is 58 degrees warm, idle", "motor that was stalled", ("C2",), _said((6, "TEMP", 58), (6, "THERM", 57))),
    WrongRig("motor-7-half", 77, _W, "motor 7 makes half its torque", "a phase with little contact", ("C9", "C12"), Departure(torque=scaled(m7=0.5))),
    WrongRig("heartbeat-1s", 78, _E, "the safety module waits a second for positions before it brakes", "firmware", ("C8",), Departure(module=ModuleTrouble(heartbeat=10.0))),
)
# fmt: on


@lru_cache(maxsize=1)
def catalogue() -> dict[str, WrongRig]:
    """Return the wrong rigs by name, in the order of their numbers."""
    rigs = (
        *_IDENTITY,
        *_WIRING,
        *_GEOMETRY,
        *_TOOL,
        *_SENSOR,
        *_BUS,
        *_MECHANICS,
        *_STOP,
        *_PLACE,
        *_OTHERS,
    )
    return {rig.name: rig for rig in rigs}


def wrong_rig(name: str) -> WrongRig:
    """Return the rig of that name.

    Raises:
        SettingsError: the catalogue has none.
    """
    rigs = catalogue()
    if name in rigs:
        return rigs[name]
    near = get_close_matches(name.lower(), rigs, n=1, cutoff=0.6)
    asked = f"Did you mean {near[0]}? " if near else ""
    raise SettingsError(
        f"There is no wrong rig {name[:60]!r}.",
        hint=f"{asked}--wrong help lists them. Nothing was started.",
    )
