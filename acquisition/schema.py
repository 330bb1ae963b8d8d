"""ROS 2 message definitions of a trial file, and CDR layouts derived from them."""

import re
import struct
from dataclasses import dataclass

import numpy as np

TIME = "int32 sec\nuint32 nanosec"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id"

CYCLE_TEXT = """\
std_msgs/Header header  # stamp = log_time (UTC of the cycle start), in wam_base
uint32 cycle  # counts every cycle, missed ones too: a step of 2 = one cycle lost
uint32 flags  # see acquisition.sample.Flag
uint64 host_ns  # CLOCK_MONOTONIC at cycle start
uint64 arm_ns  # same clock, last joint reply arrived; 0 = none
uint64 ft_ns  # same clock, used F/T sample arrived; 0 = none
uint32 ft_counter  # device counter or device time, raw; 0 = device has none
int32[7] counts  # motor positions as received (encoder counts)
float64[7] position  # rad, joints 1..7
float64[7] velocity  # rad/s, as the controller used it
float64[7] torque_command  # N m, as sent after clipping and rounding
float64[7] torque_gravity  # N m, gravity + effective mass part
float64[6] wrench  # N, N m at ft_sensor: fx fy fz tx ty tz, tare and weight removed
float64[6] wrench_raw  # N, N m at ft_sensor, calibrated but not tared
float64[3] foot_position  # m, foot sole in wam_base
float64[4] foot_orientation  # quaternion x y z w, foot in wam_base
float64[6] foot_velocity  # m/s, rad/s in wam_base: linear x y z, angular x y z
float64[3] traction  # terrain frame: v_t m/s, F_t N, F_n N (live values)
uint64 bus_ns  # CLOCK_MONOTONIC, the bus had the last joint reply; 0 = not known"""

TRUTH_TEXT = """\
std_msgs/Header header  # stamp as in Cycle
uint64 host_ns  # CLOCK_MONOTONIC of the simulation
float64[7] position  # rad, true joint positions
float64[3] sole_position  # m, true sole in wam_base
float64[3] contact_force  # N, true force of the ground on the foot, wam_base
float64[3] hand_force  # N, force of the hand on the arm, wam_base
float64[3] traction  # terrain frame, true: v_t m/s, F_t N, F_n N"""


CAN_BATCH_TEXT = """\
std_msgs/Header header
uint64[] t_ns  # CLOCK_MONOTONIC per frame
uint8[] frames  # 16 bytes each, struct can_frame, little endian"""

WRENCH_BATCH_TEXT = """\
std_msgs/Header header
uint64[] t_ns  # CLOCK_MONOTONIC, acquisition time of each sample
uint32[] counter
uint16[] status
float64[] wrench_raw  # 6 per sample, as wrench_raw of Cycle"""

LOG_TEXT = """\
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line"""

_DEPENDENCIES = {
    "builtin_interfaces/Time": TIME,
    "std_msgs/Header": HEADER,
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Wrench": (
        "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque"
    ),
    "geometry_msgs/Twist": (
        "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular"
    ),
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\n"
        "geometry_msgs/Transform transform"
    ),
    "geometry_msgs/Pose": (
        "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation"
    ),
}

_TEXTS = {
    "traction_msgs/msg/Cycle": CYCLE_TEXT,
    "traction_msgs/msg/Truth": TRUTH_TEXT,
    "traction_msgs/msg/CanBatch": CAN_BATCH_TEXT,
    "traction_msgs/msg/WrenchBatch": WRENCH_BATCH_TEXT,
    "rcl_interfaces/msg/Log": LOG_TEXT,
    "sensor_msgs/msg/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\n"
        "float64[] velocity\nfloat64[] effort"
    ),
    "geometry_msgs/msg/WrenchStamped": (
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench"
    ),
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
    "geometry_msgs/msg/TwistStamped": (
        "std_msgs/Header header\ngeometry_msgs/Twist twist"
    ),
    "std_msgs/msg/String": "string data",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
}

_SCALARS = {
    "int32": ("<i4", 4),
    "uint8": ("<u1", 1),
    "uint16": ("<u2", 2),
    "uint32": ("<u4", 4),
    "uint64": ("<u8", 8),
    "float64": ("<f8", 8),
}
_FIELD = re.compile(r"^(?P<type>[\w/]+)(\[(?P<count>\d+)\])?\s+(?P<name>\w+)$")
ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR, little endian


def schema_text(type_name: str) -> str:
    """Return the complete ros2msg definition of `type_name` with its dependencies."""
    return _complete(_TEXTS[type_name])


def _complete(text: str) -> str:
    """Append the definitions of all types type_name, recursively."""
    blocks = [text]
    included: set[str] = set()
    queue = _used_types(text)
    while queue:
        type_name = queue.pop(0)
        if type_name in included:
            continue
        included.add(type_name)
        definition = _DEPENDENCIES[type_name]
        blocks.append("=" * 80 + f"\nMSG: {type_name}\n{definition}")
        queue += _used_types(definition)
    return "\n".join(blocks)


def _fields(text: str) -> list[tuple[str, int, str]]:
    """Return (type, count, name) of every field; count 1 = a scalar."""
    fields: list[tuple[str, int, str]] = []
    for line in text.splitlines():
        match = _FIELD.match(line.split("#")[0].strip())
        if match:
            count = int(match["count"]) if match["count"] else 1
            fields.append((match["type"], count, match["name"]))
    return fields


def _used_types(text: str) -> list[str]:
    types = [line.split()[0].removesuffix("[]") for line in text.splitlines()]
    return [name for name in types if "/" in name]


@dataclass(frozen=True, slots=True)
class Layout:
    """Layout of a message of fixed size, given a constant frame_id.

    Attributes:
        type_name: ROS 2 name of the message.
        dtype: packed numpy dtype of the whole payload including the encapsulation
            header; header fields are `sec`, `nanosec`, `frame_id`. Alignment gaps are
            fields, too (`padding_28` ends at byte 28): otherwise copies would contain
            uninitialised memory and equal runs would differ.
        template: payload with header and frame_id set and zeros elsewhere.
        definition: complete ros2msg definition.
    """

    type_name: str
    dtype: np.dtype[np.void]
    template: bytes
    definition: str

    @property
    def size(self) -> int:
        """Size of one payload [bytes]."""
        return self.dtype.itemsize


def fixed_layout(type_name: str, frame_id: str) -> Layout:
    """Derive the CDR layout of `type_name` from its definition.

    Every field is aligned to its own size, counted from after the four bytes of
    encapsulation (DDS-XTypes, plain CDR). `frame_id` has a constant length, so the
    message has a fixed size.
    """
    text = _TEXTS[type_name]
    names = ["encapsulation", "sec", "nanosec", "frame_id_length", "frame_id"]
    frame = frame_id.encode() + b"\0"
    formats: list[object] = ["S4", "<i4", "<u4", "<u4", f"S{len(frame)}"]
    end = 16 + len(frame)
    for type_code, count, name in _fields(text)[1:]:
        code, size = _SCALARS[type_code]
        gap = -(end - 4) % size
        if gap:
            names.append(f"padding_{end + gap}")
            formats.append(f"V{gap}")
        names.append(name)
        formats.append((code, (count,)) if count > 1 else code)
        end += gap + size * count
    dtype = np.dtype({"names": names, "formats": formats})
    record = np.zeros(1, dtype)
    template = bytearray(record.tobytes())
    template[0:4] = ENCAPSULATION
    struct.pack_into("<I", template, 12, len(frame))
    template[16 : 16 + len(frame)] = frame
    return Layout(type_name, dtype, bytes(template), _complete(text))


CYCLE = fixed_layout("traction_msgs/msg/Cycle", "wam_base")
TRUTH = fixed_layout("traction_msgs/msg/Truth", "wam_base")
