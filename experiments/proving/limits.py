"""What every quantity of a commissioning may be, and what it means where it is not.

Measured on simulated sound arms, with room for real ones; each record keeps the limits
it was judged by, so that they can be revised from data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from experiments.commissioning.record import Measured


@dataclass(frozen=True, slots=True)
class Limit:
    """Between which values a quantity passes.

    Attributes:
        name: of the quantity; may hold `{joint}`.
        unit: of all values; "" = a number of something.
        wrong: what is the matter beyond the limits; may hold `{joint}`.
        low: the least that passes; None = no such limit.
        high: the most that passes; None = no such limit.
    """

    name: str
    unit: str
    wrong: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class Found:
    """A quantity and what is the matter where it does not pass.

    Attributes:
        measured: the quantity with its limits.
        wrong: the matter.
    """

    measured: Measured
    wrong: str


@dataclass(frozen=True, slots=True)
class Judgement:
    """What came of a step.

    Attributes:
        quantities: in the order in which they were judged.
        cause: the first contradiction, in words; "" = none.
        notes: what is not as expected and keeps nobody from going on, in words.
    """

    quantities: tuple[Measured, ...]
    cause: str
    notes: tuple[str, ...] = ()


_MOTION = "Something moves the arm that is not gravity on its stops"

LIMITS: Mapping[str, Limit] = {
    # C0
    "unusual": Limit("numbers that no sound rig has", "", "{text}", high=0),
    "load": Limit("mass on the plate", "kg", "The arm cannot bear it", high=3.0),
    "drawings": Limit(
        "gravity beside the drawings",
        "N m",
        "The gravity calibration is of another arm, or its zeros were off",
        high=5.0,
    ),
    # C1
    "listened": Limit("listened for", "s", "It was ended early", low=9.9),
    "masters": Limit(
        "other masters", "", "Another program drives this arm, frame {id:03X}", high=0
    ),
    "frames": Limit(
        "frames that nobody asked for",
        "",
        "Somebody polls the arm, or a device talks by itself",
        high=0,
    ),
    "error_frames": Limit(
        "error frames", "", "Bit rate, cable or terminators are not right", high=0
    ),
    # C2
    "nodes": Limit("motor pucks that answer", "", "A puck is silent", low=7, high=7),
    "module": Limit(
        "safety modules that answer", "", "The module is silent", low=1, high=1
    ),
    "twice": Limit(
        "answers to one question",
        "",
        "Two devices have one number: take the spare puck off the bus",
        low=1,
        high=1,
    ),
    "serials": Limit(
        "different serial numbers",
        "",
        "Two pucks say that they are the same",
        low=7,
        high=7,
    ),
    "replaced": Limit(
        "pucks that were commissioned with another serial number",
        "",
        "{text}: another arm with the same files, or a puck was replaced",
        high=0,
    ),
    "properties": Limit("properties that are not as expected", "", "{text}", high=0),
    "module_limits": Limit("limits that the module did not keep", "", "{text}", high=0),
    "refused": Limit("refusals of the start", "", "{text}", high=0),
    # C3
    "answered": Limit(
        "questions left out", "", "Too few to tell whether replies are late", low=3
    ),
    "late": Limit(
        "of these answered all the same",
        "",
        "Replies belong to an earlier question: the adapter, or another program "
        "between, keeps them back",
        high=1,
    ),
    "jumps": Limit("positions that jump", "", "An encoder or its cable", high=0),
    "answer": Limit(
        "from a question to its answer, median",
        "ms",
        "The adapter is slow (USB), or the bus is busy",
        low=0.01,
        high=1.5,
    ),
    "cycles": Limit("cycles of the loop", "", "The loop did not run", low=29_000),
    "incomplete": Limit(
        "of these without all replies",
        "",
        "Frames are lost: sample point, terminators, cable or adapter",
        high=8,
    ),
    # C4
    "stop": Limit(
        "from the stop button to pucks without power",
        "ms",
        "The stop button does not take the power away",
        high=250.0,
    ),
    "stays": Limit(
        "module that is not in E-stop after the release",
        "cycles",
        "A released stop is not kept until Shift-idle",
        high=0,
    ),
    "idles": Limit(
        "Shift-idle after the release leads to idle",
        "",
        "The pendant does not bring the module to idle",
        low=1,
        high=1,
    ),
    "asleep": Limit(
        "pucks that answer without having been woken",
        "",
        "They kept their power through the stop",
        high=0,
    ),
    "early": Limit(
        "active though nobody asked for it",
        "ms",
        "The program or the module does not go back to idle",
        high=10.0,
    ),
    "seen": Limit(
        "presses of the pendant that were seen",
        "",
        "The pendant or its cable is dead",
        low=3,
        high=3,
    ),
    # C5
    "sense": Limit(
        "sense of joint {joint}",
        "",
        "Its encoder counts backwards, or stands still",
        low=1,
    ),
    "beside": Limit(
        "way of another joint beside joint {joint}",
        "degrees",
        "Turned was joint {joint}, joint {other} went along: encoders are exchanged, "
        "or one of a differential is not what it is taken for",
        high=8.0,
    ),
    "travel": Limit(
        "travel of joint {joint} beyond the drawings",
        "%",
        "Counts per turn, or the ratio of its drive",
        low=-1.7,
        high=1.7,
    ),
    "stop_angle": Limit(
        "joint {joint} on its stop beside the drawings",
        "degrees",
        "Its zero position is off: lay the arm home and zero again",
        low=-3.0,
        high=3.0,
    ),
    # C6
    "lever": Limit(
        "moments over forces, from pose to pose",
        "mm",
        "Units of the sensor's forces or moments",
        high=250.0,
    ),
    "force_left": Limit(
        "force that turns wrongly",
        "N",
        "The sensor is turned or its axes are exchanged, or encoders are",
        high=0.35,
    ),
    "foot_mass": Limit(
        "mass of the foot beyond rig.toml",
        "%",
        "Another foot, a wrong number, or units of the sensor",
        low=-10.0,
        high=10.0,
    ),
    "weight_way": Limit(
        "weight of the foot beside down",
        "degrees",
        "The base stands otherwise, the sensor's sign is the other one, it is turned, "
        "or its cable pulls",
        high=6.0,
    ),
    "foot_centre": Limit(
        "centre of the foot beside rig.toml",
        "mm",
        "Another foot, a wrong number, or units of the sensor",
        high=7.0,
    ),
    "moment_left": Limit(
        "moment that turns wrongly",
        "mN m",
        "The sensor is turned, or its matrix is another one's",
        high=20.0,
    ),
    # C7
    "hung_scale": Limit(
        "hung weight as measured, median",
        "of it",
        "Scale of the sensor: its calibration sheet or units",
        low=0.94,
        high=1.06,
    ),
    "hung_spread": Limit(
        "hung weight from pose to pose",
        "of it",
        "The sensor's matrix is another one's",
        high=0.09,
    ),
    "fitted": Limit(
        "largest angle of the fit",
        "degrees",
        "It is {name}",
        low=-2.25,
        high=2.25,
    ),
    "sole": Limit(
        "where the string pulls beside the sole of rig.toml",
        "mm",
        "Another sole, or not the middle of it",
        high=6.0,
    ),
    "hung_way": Limit(
        "hung weight beside down, worst pose",
        "degrees",
        "An orientation is wrong: sensor, a zero position, or the base",
        high=6.0,
    ),
    # C8
    "active": Limit("active without torque", "s", "The module left it", low=0.9),
    "rest": Limit("way of joint {joint} without torque", "mrad", _MOTION),
    "silence": Limit(
        "from the last question to a module that brakes",
        "ms",
        "The module does not brake an arm that nobody asks any more: no program that "
        "ends, and no cable that breaks, would be noticed",
        high=150.0,
    ),
    # C9
    "moved": Limit(
        "way of joint {joint} the way it is pushed",
        "mrad",
        "Nothing moves, or the other way: motor {joint}, its cable, its puck's slot or "
        "torque constant, or its drive cable",
    ),
    "aside": Limit(
        "way of another joint, joint {pushed} pushed",
        "mrad",
        "Pushed was joint {joint}, moved joint {other}: motors or their cables are "
        "exchanged, or one is reversed",
    ),
    "liftoff": Limit(
        "lift-off of joint {joint} over its weight",
        "",
        "Less lifts it than it weighs: torque constant, foot, or zero position",
        low=0.75,
    ),
    # C10
    "lifted": Limit(
        "way of joint {joint} off its stop",
        "mrad",
        "The torque that should lift it does not",
        low=60.0,
        high=105.0,
    ),
    "weight": Limit(
        "weight on joint {joint} over the predicted one",
        "",
        "Masses of rig.toml, mounting, zeros, or the torque constant",
        low=0.8,
        high=1.2,
    ),
    # C11
    "gravity": Limit(
        "way of joint {joint} under its compensation",
        "mrad",
        "Compensation moves the arm: masses, mounting, zeros or torque constants",
    ),
    "share": Limit("share of the compensation reached", "", "{text}", low=1.0),
    # C12
    "rocked": Limit(
        "swing of the foot's weight, rms",
        "N",
        "The foot was not rocked enough, or positions and forces are of two things",
        low=0.4,
    ),
    "lag": Limit(
        "forces behind positions",
        "ms",
        "Forces and motion are not of one time: a buffer of the sensor or its driver, "
        "or late positions",
        low=-5.0,
        high=5.0,
    ),
    "turned": Limit(
        "moment that turned the foot", "N m", "Too little to tell", low=0.2
    ),
    "stiffness": Limit(
        "stiffness of joint 7's lock",
        "N m/rad",
        "Motor 7 makes another torque than it is told, its counts per turn, or "
        "lock_kp of rig.toml",
        low=16.0,
        high=28.0,
    ),
    "ringing": Limit(
        "swing beyond its rest once let go, over the way it was turned",
        "",
        "The lock rings: positions are late, or lock_kd of rig.toml",
        high=0.5,
    ),
    # C13
    "corners": Limit("corners make a container", "", "{text}", low=1.0),
    "flat": Limit(
        "points off the plane, rms",
        "mm",
        "A corner was not touched with the sole on the ground",
        high=6.0,
    ),
    "incline": Limit(
        "incline beyond the matrix's",
        "degrees",
        "Incline typed wrong, another container, or the base is tilted",
        low=-2.0,
        high=2.0,
    ),
    "heading": Limit(
        "heading beyond the matrix's",
        "degrees",
        "Heading typed wrong, or the container or the base is turned",
        low=-3.0,
        high=3.0,
    ),
    "far_end": Limit(
        "far end from the matrix's",
        "mm",
        "far_end typed wrong, or the container stands elsewhere",
        high=25.0,
    ),
    "short": Limit(
        "travel of the matrix beyond the container",
        "mm",
        "travel is longer than the container: the foot would meet its wall",
        high=25.0,
    ),
    # C14
    "pressed": Limit(
        "force on the kitchen scale", "N", "Too little to compare", low=15.0
    ),
    "scale": Limit(
        "sensor beyond the kitchen scale",
        "N",
        "Scale of the sensor, or the scale was read wrongly",
    ),
    "pulled": Limit("pull of the spring balance", "N", "Too little to compare", low=5),
    "balance": Limit(
        "sensor beyond the spring balance",
        "N",
        "Scale of the sensor across its axis, or the balance was not held level",
    ),
    # the check of every day, beside the commissioning
    "changed": Limit(
        "devices that say something else of themselves",
        "",
        "Changed since the commissioning: {text}",
        high=0,
    ),
    "exchange": Limit(
        "seven positions after their question, median",
        "ms",
        "The adapter is slow, or the bus is busy",
        low=0.01,
        high=1.5,
    ),
    "zero": Limit(
        "zero beside mech_at_home, worst joint",
        "degrees",
        "The arm is zeroed elsewhere: lay it home and zero again",
        high=1.7,
    ),
    "hang_force": Limit(
        "weight of the foot beside the commissioning",
        "N",
        "Another foot, something touches it, the sensor's scale or its cable",
        high=0.35,
    ),
    "hang_way": Limit(
        "weight of the foot turned beside it",
        "degrees",
        "A zero position, the sensor or the base was turned",
        high=6.0,
    ),
    "drift": Limit(
        "lift-off of joint {joint} over that of the commissioning",
        "",
        "Motor {joint}, its drive cable, or friction: less lifts it where a cable is "
        "off or the zero is wrong, more where something rubs or a phase is open",
        low=0.85,
        high=1.15,
    ),
    "ended": Limit("stops by the guard", "", "{text}", high=0),
}


def found(
    key: str,
    value: float,
    *,
    low: float | None = None,
    high: float | None = None,
    **fields: object,
) -> Found:
    """Return a quantity beside its limits.

    Args:
        key: of `LIMITS`.
        value: as measured.
        low: in place of the least there, where it differs by joint.
        high: in place of the most there.
        fields: what its words hold.
    """
    limit = LIMITS[key]
    measured = Measured(
        name=limit.name.format(**fields),
        value=float(value),
        unit=limit.unit,
        low=limit.low if low is None else low,
        high=limit.high if high is None else high,
    )
    return Found(measured, limit.wrong.format(**fields) if fields else limit.wrong)


def judged(rows: Sequence[Found], notes: Sequence[str] = ()) -> Judgement:
    """Return what a step's quantities say together; the first that fails is named."""
    first = next((row for row in rows if not row.measured.is_within), None)
    cause = "" if first is None else f"{first.measured.text}. {first.wrong}"
    quantities = tuple(row.measured for row in rows)
    return Judgement(quantities, cause[:400], tuple(notes))
