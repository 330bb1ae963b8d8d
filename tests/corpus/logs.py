"""Logs of other robots and their URDFs: valid samples and their readers."""

import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from acquisition.cdr import CdrWriter
from analysis.logs.importing import import_log
from analysis.logs.messages import (
    MessageError,
    read_header,
    read_joints,
    read_wrench,
)
from analysis.logs.record import RECORD, read_record
from analysis.logs.robot import RobotLeg, parse_urdf
from analysis.logs.suggestions import ListRequest, listing
from tests.analysis.logs.gantry import (
    URDF,
    StrokeLog,
    import_request,
    write_bag,
    write_bag2,
)

SHORT = StrokeLog(joint_rate=100.0, wrench_rate=100.0)


def log_reader(name: str) -> Callable[[bytes, Path], None]:
    """Return a reader that lists and imports its bytes as the log file `name`."""

    def read(data: bytes, folder: Path) -> None:
        path, urdf = folder / name, folder / "robot.urdf"
        path.write_bytes(data)
        urdf.write_text(URDF)
        for _ in listing(ListRequest(path, urdf, "foot", "gauge", "ground-on-foot")):
            pass
        import_log(import_request(SHORT, path, urdf))

    return read


def read_urdf_bytes(data: bytes, _: Path) -> None:
    robot = parse_urdf(Path("robot.urdf"), data)
    RobotLeg(robot, "foot", "gauge")


def read_message(data: bytes, _: Path) -> None:
    """Read `data` as every message in each serialization."""
    for serialization in ("cdr", "ros1"):
        for read in (read_joints, read_wrench, read_header):
            try:
                read(data, serialization)
            except MessageError:
                continue


def read_import_record(data: bytes, folder: Path) -> None:
    (folder / RECORD).write_bytes(data)
    read_record(folder)


@cache
def log_samples() -> dict[str, bytes]:
    """Return one valid input of each kind, by name."""
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
        "message": _MESSAGE,
        "import-record": _RECORD.encode(),
    }


_MESSAGE = (
    CdrWriter()
    .header(1_500_000_000_250_000_000, "base")
    .strings(["hip", "knee"])
    .sequence(np.array([0.5, -2.0]))
    .sequence(np.zeros(2))
    .sequence(np.zeros(0))
    .finish()
)
_RECORD = """\
{"format": "traction-import", "version": 1, "log_format": "MCAP", "robot": "leg",
"joints": ["hip"], "is_estimated": false, "files": [{"what": "log", "path": "log.mcap",
"bytes": 12, "sha256": "ab"}], "topics": [{"what": "wrench", "name": "/ft", "type":
"geometry_msgs/WrenchStamped", "times": "stamp", "read": 3, "used": 3, "dropped": 0,
"repeated": 0, "overtaken": 0, "rate_by_stamp": 800.0, "rate_by_receipt": null,
"late_ms": [1.0, 2.0], "longest_gap_ms": 2.5}], "arguments": {"to": "DIR"}, "checks":
[{"name": "lag", "value": [18.0], "unit": "ms", "shown": [17], "spread": [13, 23]}],
"trials": {"T01": [3.0, 13.0]}, "warnings": ["w"], "losses": [],
"versions": {"numpy": "2"}}
"""
