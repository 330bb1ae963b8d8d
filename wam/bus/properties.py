"""Property numbers of the pucks by device, firmware and name.

The numbers changed between firmware versions, so a driver reads VERS and looks them up
here. The tables are libbarrett's, written as `NAME number@first_version`; a dash means
that the property does not exist from that version on.
"""

from enum import Enum, IntEnum
from functools import cache

from acquisition.errors import SettingsError

WIDE = frozenset(
    "P DP E OT CT M MECH CTS IOFF HALLH EN JP JOFST PEN".split()  # noqa: SIM905
)

COMMON = {
    name: number
    for number, name in enumerate("VERS ROLE SN ID ERROR STAT ADDR VALUE".split())  # noqa: SIM905
}

_GAUGES = "SG1 SG2 SG3 SG4 SG5 SG6 FX FY FZ TX TY TZ FT AX AY AZ GM OV LED T1 T2 T3 A"
SENSOR = {name: number for number, name in enumerate(_GAUGES.split(), 42)}

MOTOR = """\
A -@32 104@114 -@119
ACCEL 69@32 71@33 69@36 79@61 82@65
ADDR 6@32
ANA0 44@32 18@61
ANA1 45@32 19@61
BAUD 38@32 12@61
CMD -@32 29@61
CT 36@32 56@61
CTS 30@32 65@61 66@64 68@65
D 9@32 -@50
DEF 89@32 91@33 89@36 32@61
DIG0 42@32 14@61
DIG1 43@32 15@61
DP 32@32 50@61
DS 59@32 61@33 59@36 70@61 58@64 60@65
DUMP 74@32 76@33 74@36 -@61
E 13@32 14@47 52@61
ECMAX -@32 113@44 91@61 96@65 100@125 101@132
ECMIN -@32 114@44 92@61 97@65 101@125 102@132
EN 63@32 65@33 63@36 74@61 77@65 94@132
ERROR 4@32
FET0 14@32 13@47 11@50 16@61
FET1 70@32 72@33 70@36 17@61
FIND -@32 117@45 33@61
GAIN1 79@32 81@33 79@36 -@61
GAIN2 80@32 82@33 80@36 -@61
GAIN3 81@32 83@33 81@36 -@61
GRPA 51@32 26@61
GRPB 52@32 27@61
GRPC 53@32 28@61
HALLH -@32 110@44 85@61 84@64 87@65 88@68
HALLS -@32 109@44 84@61 86@64 89@65 87@68
HOLD -@32 94@65 77@132
HSG 57@32 59@33 57@36 68@61 69@64 71@65
ID 3@32
IHIT -@32 108@175
IKCOR 103@32 105@33 103@36 90@61 93@65
IKI 102@32 104@33 102@36 89@61 92@65
IKP 101@32 103@33 101@36 88@61 91@65
ILOGIC 50@32 24@61
IMOTOR 48@32 22@61
IOFF 61@32 63@33 61@36 72@61 74@65
IOFST 21@32 59@61 60@64 62@65
IPNM -@32 57@33 108@36 83@61 86@65
ISQ -@32 115@45 -@61
ITOR -@32 108@168 -@175
IVEL 60@32 62@33 60@36 71@61 73@65
JIDX -@32 55@33 107@36 82@61 85@65
JOFST -@32 98@125
JP -@32 96@125
KD 66@32 68@33 66@36 77@61 80@65
KI 67@32 69@33 67@36 78@61 81@65
KP 65@32 67@33 65@36 76@61 79@65
LCTC -@32 95@61 94@63 99@65 103@125 104@132
LCV -@32 118@50 -@61
LCVC -@32 119@51 94@61 95@63 100@65 104@125 105@132
LFAP -@32 121@50 122@51 -@61
LFDP -@32 122@50 123@51 -@61
LFLAGS -@32 93@61 98@65 102@125 103@132
LFS -@32 120@50 121@51 -@61
LFT -@32 123@50 124@51 -@61
LFV -@32 119@50 120@51 -@61
LOAD 88@32 90@33 88@36 31@61
LOCK 41@32 13@61
LOG 73@32 75@33 73@36 -@61
LOG1 75@32 77@33 75@36 -@61
LOG2 76@32 78@33 76@36 -@61
LOG3 77@32 79@33 77@36 -@61
LOG4 78@32 80@33 78@36 -@61
LSG 58@32 60@33 58@36 69@61 70@64 72@65
M -@32 96@61 58@65
MCV 18@32 46@61
MD 15@32 -@47
MDS 25@32 62@61 63@64 65@65
MECH 28@32 63@61 64@64 66@65
MODE 8@32
MOFST 20@32 58@61 59@64 61@65
MOV 19@32 47@61
MPE 62@32 64@33 62@36 73@61 76@65
MT 16@32 43@61
MV 17@32 45@61
OD 24@32 61@61 62@64 64@65
OFFSET1 82@32 84@33 82@36 -@61
OFFSET2 83@32 85@33 83@36 -@61
OFFSET3 84@32 86@33 84@36 -@61
OT 34@32 54@61
OTEMP 40@32 11@61
P 26@32 48@61
PDATA -@32 102@114 -@119
PIDX 54@32 67@61 68@64 70@65
PLOG -@32 101@114 -@119
POLES -@32 112@44 87@61 90@65
PTEMP 22@32 10@61
RATIO 72@32 74@33 72@36 -@61
ROLE 1@32
SAMPLE 68@32 70@33 68@36 -@61
SAVE 87@32 89@33 87@36 30@61
SG 56@32 58@33 56@36 25@61
SN 2@32
STAT 5@32
T 10@32 9@50 42@61
TACT -@32 106@142
TACTID -@32 107@145
TEMP 39@32 9@61
TENSION 70@32 72@33 70@36 17@61
TENSO -@32 108@33 106@36 81@61 84@65
TENST -@32 107@33 105@36 80@61 83@65
TETAE -@32 116@45 -@61
THERM 46@32 20@61
TIE -@32 95@65 100@132
TSTOP 64@32 66@33 64@36 75@61 78@65
UNITS 71@32 73@33 71@36 -@61
UPSECS 23@32 60@61 61@64 63@65
V 12@32 10@50 44@61 106@114 44@119
VALUE 7@32
VALUE32 -@32 124@50 125@51 -@61
VBUS 47@32 21@61
VCMD -@32 44@114 -@119
VERS 0@32
VLOGIC 49@32 23@61
X0 -@32 34@61
X1 -@32 35@61
X2 -@32 36@61
X3 -@32 37@61
X4 -@32 38@61
X5 -@32 39@61
X6 -@32 40@61
X7 -@32 41@61"""

SAFETY = """\
IFAULT 100@32 102@33 100@36 55@61
MAXPWR 98@32 100@33 98@36 54@61
PEN 85@32 87@33 85@36 43@61
PWR 99@32 101@33 99@36 53@61
SAFE 86@32 88@33 86@36 44@61
TL1 92@32 94@33 92@36 47@61
TL2 93@32 95@33 93@36 48@61
VL1 90@32 92@33 90@36 45@61
VL2 91@32 93@33 91@36 46@61
VNOM 104@32 106@33 104@36 56@61
VOLTH1 96@32 98@33 96@36 51@61
VOLTH2 97@32 99@33 97@36 52@61
VOLTL1 94@32 96@33 94@36 49@61
VOLTL2 95@32 97@33 95@36 50@61
ZERO 55@32 56@33 55@36 42@61"""


MODERN = 61  # first firmware with separate tables for motors and safety module
FIRST_RELEASED, NEWEST_DOCUMENTED = 32, 200
POLES_OF_WRIST = 6
POLES_OF_GIMBALS = 8
MAGNETIC_ENCODER = 0x0100


class Device(Enum):
    """Kinds of device, each with its own property table."""

    MOTOR = "motor puck"
    SAFETY = "safety module"
    SENSOR = "force/torque sensor"
    MONITOR = "sleeping puck"


class PuckRole(IntEnum):
    """The low five bits of ROLE."""

    TATER = 0
    GIMBALS = 1
    SAFETY = 2
    WRAPTOR = 3
    TRIGGER = 4
    BHAND = 5
    FORCE = 6


class PuckStatus(IntEnum):
    """Values of STAT."""

    RESET = 0
    ERROR = 1
    READY = 2


class PuckMode(IntEnum):
    """Values of MODE on a motor puck; the arm uses IDLE and TORQUE only."""

    IDLE = 0
    DUTY = 1
    TORQUE = 2
    PID = 3
    VELOCITY = 4
    TRAPEZOIDAL = 5


def device_of(role: int, stat: int = PuckStatus.READY) -> Device | None:
    """Return the kind of device of a ROLE and STAT, None for an unknown role."""
    if stat == PuckStatus.RESET:
        return Device.MONITOR
    kinds = {
        PuckRole.TATER: Device.MOTOR,
        PuckRole.WRAPTOR: Device.MOTOR,
        PuckRole.BHAND: Device.MOTOR,
        PuckRole.SAFETY: Device.SAFETY,
        PuckRole.FORCE: Device.SENSOR,
    }
    return kinds.get(role & 0x1F)  # pyright: ignore[reportArgumentType, reportCallIssue]


def property_number(device: Device, name: str, vers: int = MODERN) -> int:
    """Return the number of property `name` on `device` with firmware `vers`.

    Raises:
        SettingsError: the firmware does not have the property.
    """
    number = numbers(device, vers).get(name)
    if number is None:
        raise SettingsError(
            f"A {device.value} with firmware {vers} has no property {name}.",
            hint="Is the firmware older or newer than this program knows?",
        )
    return number


@cache
def numbers(device: Device, vers: int = MODERN) -> dict[str, int]:
    """Return the property numbers of `device` with firmware `vers`, by name."""
    common = dict(COMMON)
    if device is Device.MONITOR:
        return common | {"LOCK": 8, "SAVE": 9, "LOAD": 10}
    if device is Device.SENSOR:
        return common | _shared(_at(MOTOR, MODERN)) | SENSOR
    if vers < FIRST_RELEASED:
        return common
    motor = _at(MOTOR, vers)
    if device is Device.MOTOR:
        return motor
    inherited = motor if vers < MODERN else _shared(motor)
    return inherited | _at(SAFETY, vers)


@cache
def names(device: Device, vers: int = MODERN) -> dict[int, str]:
    """Return the property names by number; the first one where two share a number."""
    table: dict[int, str] = {}
    for name, number in numbers(device, vers).items():
        table.setdefault(number, name)
    return table


def is_wide(name: str) -> bool:
    """Return whether replies of a property carry 32 bits instead of 16."""
    return name in WIDE


def nearest_documented(vers: int) -> int:
    """Return the documented firmware version nearest to `vers`."""
    return min(max(vers, FIRST_RELEASED), NEWEST_DOCUMENTED)


def _shared(motor: dict[str, int]) -> dict[str, int]:
    """Return the part of a modern motor table that all devices share."""
    return {name: number for name, number in motor.items() if number <= 41}


def _at(table: str, vers: int) -> dict[str, int]:
    """Return the property numbers of a table for firmware `vers`."""
    numbers_by_name: dict[str, int] = {}
    for line in table.splitlines():
        name, *entries = line.split()
        for number, first in (entry.split("@") for entry in entries):
            if int(first) <= vers:
                numbers_by_name.pop(name, None)
                if number != "-":
                    numbers_by_name[name] = int(number)
    return numbers_by_name
