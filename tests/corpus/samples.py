"""One small valid input of each kind, to be mutated."""

import hashlib
import io
import json
from functools import cache
from importlib import resources

import numpy as np

from acquisition import formats
from analysis.study.slip_risk import BREAK_AWAY, BreakAwayModel, PushLaw
from analysis.tables.data_package import TableOrigin
from analysis.tables.parquet import to_parquet
from analysis.terrains.database import FORMAT, VERSION
from fakes.plant.friction import draw_friction
from fakes.sensor.kinds import SERIAL_KINDS, SensorChoice, make_stream
from ft_sensor.calibration.files import payload_to_toml, terrain_to_toml
from ft_sensor.calibration.fit import SensorFit
from ft_sensor.calibration.sensor_file import SensorCalibration, sensor_to_toml
from ft_sensor.payload import TerrainFrame, payload_of
from tests.corpus.copied_session import all_lines, all_names
from tests.corpus.logs import log_samples
from tests.corpus.readers import EVENTS, PACKAGED, RESULTS, journal_of
from tests.corpus.used_session import session_file
from wam.bus.frames import encode_force, encode_position, encode_torques
from wam.calibration.friction_file import FrictionCalibration, friction_to_toml
from wam.calibration.friction_fit import FrictionFit
from wam.calibration.gravity_file import GravityCalibration, gravity_to_toml
from wam.model.constants import Body, load_constants
from wam.model.tool import Tool

_TOOL = Tool(
    Body(0.136, np.array([0.0, 0.0, 0.006]), np.diag([7e-5, 7e-5, 1.4e-4])),
    Body(0.45, np.array([0.01, 0.0, 0.062]), np.diag([4e-4, 5.5e-4, 4.5e-4])),
    np.array([0.01, 0.0, 0.112]),
)
_UTC = "2027-01-15T08:00:00Z"
_SECOND = {"trial": 2, "attempt": 1}
_JOURNAL = journal_of(
    *EVENTS,
    {"event": "trial-recorded", "trial": 1, "attempt": 1},
    {"event": "trial-kept", "trial": 1, "attempt": 1, "reason": "", "who": "mk"},
    {"event": "trial-started", **_SECOND},
    {"event": "trial-rejected", **_SECOND, "reason": "too fast"},
    {"event": "session-ended", "reason": "unfinished"},
    {"event": "verdict-changed", **_SECOND, "verdict": "keep"},
)
_SIDECAR = {"trial": "T01", "attempt": 1, "sha256": "", "verdict": "keep"}
_SCRIPT = b"keep\nredo 2  # again\nremark wet\nquit\n"
_POSES = b"""\
poses = [
  [0.0, -0.4, 0.0, 1.8, 0.0, -0.4, 0.0],
  [0.0, -0.6, 0.3, 1.9, 0.2, -0.4, 0.0],
  [0.0, -0.2, 0.0, 1.7, 0.0, 0.0, 0.0],
]
"""
_PRESSES = b"0 activate\n2.5 idle  # a pause\nactivate\n30 quit\n"
_LOG = b"""\
(1800000000.000100) can0 404#16
(1800000000.000400) can0 463#00C000
(1800000000.000900) can0 405#AA80000000000000
"""
# Tables written by other programs.
_GERMAN = """\
t [s];v_t [mm/s];F_n [N];F_t [N]
0,000;100,0;13,25;0,89
0,002;100,5;13,50;0,91
0,004;101,0;13,75;0,90
0,006;101,5;14,00;0,92
"""
_PREAMBLE = """\
# Test bench 4
Operator:,somebody
Date:,2027-01-15

t,v_t,F_n,F_t
s,m/s,N,N
0.0,0.1,2.0,1.0
0.1,0.1,2.1,1.0
0.2,0.1,2.0,nan
0.3,0.1,,1.0
0.4,0.1,2.0,1.1
0.5,0.1,2.2,1.0
0.6,0.1,2.0,1.0
0.7,0.1,2.1,1.0
0.8,0.1,2.0,1.2
0.9,0.1,2.0,1.0
"""
_ISO = """\
t\tv_t\tF_n\tF_t
2027-01-15T08:00:00.000Z\t0.1\t2\t1
2027-01-15T08:00:00.002Z\t0.1\t2\t1
2027-01-15T08:00:00.004Z\t0.1\t2\t1
2027-01-15T08:00:00.006Z\t0.1\t2\t1
"""


def _gravity() -> str:
    rng = np.random.default_rng(1)
    stored = GravityCalibration(
        mus=rng.normal(size=(7, 3)),
        residual=0.02,
        rank=12,
        foot="tread",
        tool=_TOOL,
        measured_utc=_UTC,
        is_simulated=True,
        poses=rng.normal(size=(10, 7)),
        torques=rng.normal(size=(10, 7)),
    )
    return gravity_to_toml(stored)


def _friction() -> str:
    constants = load_constants()
    friction = draw_friction(constants, 0.4, None, np.zeros(7))
    little = 0.01 * friction.coulomb
    fit = FrictionFit(friction, little, little, np.full(7, 0.02), (100,) * 7)
    stored = FrictionCalibration(fit, "tread", "cad", _UTC, is_simulated=True)
    return friction_to_toml(stored, constants)


def _sensor_calibration() -> str:
    fit = SensorFit(0.5, np.zeros(3), np.zeros(6), 0.0, 1.0, 0.02, 0.001)
    stored = SensorCalibration(
        fit, "tread", 0.1, _UTC, True, np.stack([np.eye(3)] * 6), np.zeros((6, 6))
    )
    return sensor_to_toml(stored)


def _database() -> dict[str, object]:
    table = [[1.0, 2.0], [2.0, 3.0]]
    model = {"title": "GP", "quantiles": [table, table], "parameters": {"mu": 0.6}}
    terrain = {"kind": "stones", "trials": 3, "samples": 90, "rho": 0.5}
    law = PushLaw(2.2, 0.5, 0.3, 0.1)
    rest = BreakAwayModel(
        kind=BREAK_AWAY,
        law=law,
        draws=np.array([law.values]),
        v_slip=0.06,
        slips=20,
        held=3,
        trials=3,
        loads=(1.0, 5.0),
        forces=(3.0, 12.0),
    )
    terrain |= {"break_away": rest.to_dict(), "roughness": {"50": -1.0}}
    return {
        "format": FORMAT,
        "version": VERSION,
        "simulated": True,
        "made_utc": _UTC,
        "default": "gp",
        "recogniser": "gp",
        "shares": [0.1, 0.9],
        "axes": {"F_n": [1.0, 5.0], "v_t": [0.0, 0.1]},
        "terrains": {"S0": {**terrain, "limits": {"2": 0.1}, "models": {"gp": model}}},
    }


def _npz() -> bytes:
    rows = np.column_stack([np.arange(5.0), np.ones(5), np.ones(5), np.ones(5)])
    file = io.BytesIO()
    np.savez(file, **{"TF/00": rows})
    return file.getvalue()


def _parquet() -> bytes:
    ramp = np.arange(5.0)
    columns = {"t": ramp, "v_t": ramp, "F_n": np.ones(5), "F_t": np.ones(5)}
    origin = TableOrigin(table="trial", session="S001", trial="T01", terrain="TF")
    return to_parquet(columns, {"v_t": "mm/s"}, origin)


def _package() -> bytes:
    entry = {
        "name": "t01",
        "path": "T01.csv",
        "format": "csv",
        "mediatype": "text/csv",
        "bytes": len(PACKAGED),
        "hash": f"sha256:{hashlib.sha256(PACKAGED).hexdigest()}",
        "schema": {"fields": [{"name": "t [s]", "type": "number", "unit": "s"}]},
        "traction": {"table": "trial", "terrain": "TF", "incline_deg": 5.0},
    }
    package = {"name": "p", "version": formats.FORMAT, "resources": [entry]}
    return json.dumps(package).encode()


def _sums() -> bytes:
    return f"{hashlib.sha256(PACKAGED).hexdigest()}  T01.csv\n".encode()


def _frames() -> bytes:
    payloads = (
        encode_force((1.0, 2.0, 3.0)),
        encode_position(-5),
        encode_torques([9] * 4),
    )
    return b"".join(b"\x63\x04" + payload.ljust(8, b"\0") for payload in payloads)


def _stream() -> bytes:
    """Return 20 ms of the stream of each sensor kind."""
    data = bytearray()
    for kind in SERIAL_KINDS:
        stream = make_stream(SensorChoice(kind), lambda _: (1.0,) * 6, None, 0)
        data += b"".join(chunk for _, chunk in stream.due(20_000_000))
    return bytes(data)


@cache
def samples() -> dict[str, bytes]:
    """Return a valid input for every reader, by name."""
    shipped = resources.files("experiments.data")
    payload = payload_of(_TOOL)
    frame = TerrainFrame(0.1, 0.2, (0.7, 0.1, 0.12), 0.45)
    texts = {
        "rig": (shipped / "rig.toml").read_text(),
        "arm-model": (resources.files("wam.data") / "wam7.toml").read_text(),
        "matrix": (shipped / "matrix.toml").read_text(),
        "gravity": _gravity(),
        "friction": _friction(),
        "foot": payload_to_toml(payload, _TOOL.sole),
        "terrain": terrain_to_toml("S10", frame, {"measured": _UTC}),
        "sensor-calibration": _sensor_calibration(),
        "database": json.dumps(_database()),
        "sidecar": json.dumps(_SIDECAR),
        "session": json.dumps({"kept": ["T01"], "phase": "unfinished"}),
        "german-table": "\ufeff" + _GERMAN,
        "preamble-table": _PREAMBLE,
        "iso-table": _ISO,
        "table": "t,v_t,F_n,F_t\n0,0.1,2,1\n0.1,0.1,2,1\n0.2,0.1,2,1\n",
    }
    return {name: text.encode() for name, text in texts.items()} | {
        "journal": _JOURNAL,
        "partial": session_file("trials/T01.mcap")[:-700],
        "mcap": session_file("trials/T01.mcap"),
        "lock": b'{"pid": 4711, "since": "2027-01-15T08:00:00Z"}',
        "used-sidecar": session_file("trials/T01.json"),
        "used-rejected": session_file("rejected/T01a.json"),
        "used-session": session_file("/session.json"),
        "used-journal": session_file("/events.jsonl"),
        "used-mcap": session_file("trials/T01.mcap"),
        "npz": _npz(),
        "parquet": _parquet(),
        "package": _package(),
        "sums": _sums(),
        "results": RESULTS.encode(),
        "script": _SCRIPT,
        "poses": _POSES,
        "presses": _PRESSES,
        "bus-log": _LOG,
        "frames": _frames(),
        "sensor": _stream(),
        "journal-lines": all_lines(),
        "session-names": all_names(),
        **log_samples(),
    }
