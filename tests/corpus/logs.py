"""Logs of other robots and their URDFs: sound samples, and how they are read."""

import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

from analysis.logs.channels import stamp_of, wrench_fields
from analysis.logs.decoding import MessageError, decoded
from analysis.logs.definitions import DefinitionError, message_type
from analysis.logs.importing import ImportRequest, import_log
from analysis.logs.opening import open_log
from analysis.logs.record import RECORD, read_record
from analysis.logs.robot import RobotLeg, parse_urdf
from tests.analysis.logs.gantry import URDF, Rubbing, write_bag, write_bag2

SHORT = Rubbing(joint_rate=100.0, wrench_rate=100.0)
_MESSAGE = bytes([0, 1, 0, 0]) + bytes(200)


def read_log(name: str) -> Callable[[bytes, Path], None]:
    """Return a reader that lists its bytes as a log, and imports them."""

    def read(data: bytes, folder: Path) -> None:
        path, urdf = folder / name, folder / "robot.urdf"
        path.write_bytes(data)
        urdf.write_text(URDF)
        with open_log(path) as log:
            for topic in log.topics.values():
                wrench_fields(topic)
            for message in log.messages(log.topics):
                stamp_of(log.topics[message.topic], message.data)
        import_log(
            ImportRequest(path, urdf, "foot", "gauge", "ground-on-foot", mass=0.3)
        )

    return read


def read_urdf_bytes(data: bytes, _: Path) -> None:
    robot = parse_urdf(Path("robot.urdf"), data)
    RobotLeg(robot, "foot", "gauge")


def read_definition(data: bytes, _: Path) -> None:
    """Interpret `data` as a definition, and a message of zeros by it."""
    text = data.decode(errors="replace")
    for serialization in ("cdr", "ros1"):
        try:
            kind = message_type("x/Y", text, serialization)
            decoded(_MESSAGE, kind, serialization)
        except (DefinitionError, MessageError):
            continue


def read_import_record(data: bytes, folder: Path) -> None:
    (folder / RECORD).write_bytes(data)
    read_record(folder)


@cache
def log_samples() -> dict[str, bytes]:
    """Return a sound input of every kind."""
    with tempfile.TemporaryDirectory(prefix="corpus-") as scratch:
        folder = Path(scratch)
        bag = write_bag(folder / "log.bag", SHORT)
        mcap = write_bag2(folder / "mcap", SHORT)
        db3 = write_bag2(folder / "db3", SHORT, "SQLITE3")
        logs = {
            "log-bag": bag.read_bytes(),
            "log-mcap": next(mcap.glob("*.mcap")).read_bytes(),
            "log-db3": next(db3.glob("*.db3")).read_bytes(),
        }
    return logs | {
        "urdf": URDF.encode(),
        "definition": _DEFINITION.encode(),
        "import-record": _RECORD.encode(),
    }


_DEFINITION = f"""\
std_msgs/Header header
string<=20 name 'x'
float64[6] wrench
uint8[<=9] states
Part[] parts
int32 KNOWN = 5
{"=" * 80}
MSG: x/Part
bool is_there
geometry_msgs/Vector3[2] force
{"=" * 80}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{"=" * 80}
MSG: std_msgs/Header
uint32 seq
string frame_id
"""
_RECORD = """\
{"format": "traction-import", "version": 1, "log_format": "MCAP", "robot": "leg",
"joints": ["hip"], "is_estimated": false, "files": [{"what": "log", "path": "log.mcap",
"bytes": 12, "sha256": "ab"}], "topics": [{"what": "wrench", "name": "/ft", "type":
"geometry_msgs/WrenchStamped", "times": "stamp", "read": 3, "used": 3, "dropped": 0,
"repeated": 0, "overtaken": 0, "rate_by_stamp": 800.0, "rate_by_receipt": null,
"late_ms": [1.0, 2.0], "longest_gap_ms": 2.5}], "arguments": {"to": "DIR"}, "estimates":
[{"name": "lag", "value": [18.0], "unit": "ms", "spread": [13, 23], "how": "found"}],
"checks": [], "trials": {"T01": [3.0, 13.0]}, "warnings": ["w"], "losses": [],
"versions": {"numpy": "2"}}
"""
