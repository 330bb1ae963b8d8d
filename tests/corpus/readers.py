"""Readers of every kind of input, as functions of bytes and a folder.

A reader writes the bytes to their usual place in the empty folder and reads them as the
program does. It returns or raises a `TractionError`; anything else is a failure.
"""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from acquisition.clock import SystemClock
from acquisition.errors import TractionError, TrialFileError
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import recover_file
from analysis.tables.loading import load_tables
from analysis.terrains import database as terrain_db
from experiments.calibration.pose_file import read_poses
from experiments.export.checksums import SUMS, changed_files
from experiments.export.rebuilding import compare_tables
from experiments.operator.pendant import read_script
from experiments.operator.scripted import ScriptedOperator
from experiments.rig.law_calibrations import build_compensation
from experiments.session.crash_recovery import recover_session
from experiments.session.data_files import journal_line
from experiments.session.journal import open_journal
from experiments.session.lock import session_lock
from experiments.session.status_table import count_rows, summarise_sessions
from experiments.session.store import list_sessions
from experiments.session.summaries import Checksums
from experiments.session.unfinished import find_unfinished
from experiments.session.where import Where
from experiments.settings.load import load_settings
from experiments.settings.rig import FrictionSettings
from ft_sensor.calibration.files import payload_from_toml, terrain_from_toml
from ft_sensor.calibration.sensor_file import sensor_from_toml
from ft_sensor.reading import StreamTiming
from ft_sensor.serial_line.timestamps import SampleTimestamper
from ft_sensor.vendors import ati, bota, optoforce, robotous
from tests.corpus.copied_session import check_lines, check_names
from tests.corpus.logs import (
    log_reader,
    read_import_record,
    read_message,
    read_urdf_bytes,
)
from tests.corpus.used_session import run_commands
from wam.bus.decoder import BusReader
from wam.bus.frames import (
    FrameError,
    decode_acceleration,
    decode_force,
    decode_joint_encoder,
    decode_position,
    decode_reply,
    decode_request,
    decode_torque,
    decode_torques,
    split_id,
)
from wam.bus.log import CanLogError, parse_log
from wam.calibration.gravity_file import gravity_from_toml
from wam.model.constants import load_constants

SESSION = "2027-01-15_S001_TF.fake"
_DECODERS = (
    decode_acceleration,
    decode_force,
    decode_joint_encoder,
    decode_position,
    decode_reply,
    decode_request,
    decode_torque,
    decode_torques,
)
_RANGES = (400.0, 400.0, 1000.0, 10.0, 10.0, 10.0)
_WRAP = 1 << 32
_TIMING = StreamTiming(1_250_000.0, 803_000, _WRAP, 1000.0, 50_000_000, 37)


def _session(folder: Path, name: str, data: bytes, journal: bytes = b"") -> None:
    """Write a session with one damaged file into `folder`, inspect and recover it."""
    path = folder / "sessions" / SESSION
    for below in ("trials", "rejected", "faults"):
        (path / below).mkdir(parents=True)
    (path / "events.jsonl").write_bytes(journal)
    (path / name).write_bytes(data)
    find_unfinished(folder)
    matrix = load_settings(None).matrix
    count_rows(summarise_sessions(folder, Where(), Checksums()), matrix)
    (session,) = list_sessions(folder)
    with session_lock(session):
        recover_session(open_journal(session, SystemClock()))


def _settings(name: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        (folder / "rig.toml").write_text("")
        (folder / name).write_bytes(data)
        config = folder / "rig.toml"
        if name == "matrix.toml":
            shipped = load_settings(None).rig_text
            config.write_text(shipped)
        load_settings(config)

    return read


def _text(parse: Callable[[str], object]) -> Callable[[bytes, Path], None]:
    """Return a reader that decodes its bytes as UTF-8 and parses the text."""
    return lambda data, _: parse(data.decode(errors="replace"))


def _compensate(text: str) -> None:
    used = FrictionSettings(model="calibrated")
    rig = load_settings(None).rig.model_copy(update={"friction": used})
    build_compensation(rig, text, is_simulated=True)


def _table(name: str, **layout: Any) -> Callable[[bytes, Path], None]:
    """Return a reader of a table with the given options of `load_tables`."""

    def read(data: bytes, folder: Path) -> None:
        (folder / name).write_bytes(data)
        load_tables([folder / name], **layout)

    return read


PACKAGED = b"t [s],v_t [m/s],F_n [N],F_t [N]\n0,0.1,2,1\n0.1,0.1,2,1\n0.2,0.1,2,1\n"


def _package(data: bytes, folder: Path) -> None:
    """Read `data` as the data package of a folder with one valid table."""
    (folder / "T01.csv").write_bytes(PACKAGED)
    (folder / "datapackage.json").write_bytes(data)
    for path in (folder, folder / "T01.csv"):
        with contextlib.suppress(TractionError):
            load_tables([path])
    load_tables([folder])


def _sums(data: bytes, folder: Path) -> None:
    (folder / "T01.csv").write_bytes(PACKAGED)
    (folder / SUMS).write_bytes(data)
    changed_files(folder)


def _results(data: bytes, _: Path) -> None:
    compare_tables(data.decode(errors="replace"), RESULTS)


def _database(data: bytes, folder: Path) -> None:
    path = folder / "terrains.json"
    path.write_bytes(data)
    database = terrain_db.load(path)
    for name in database.terrains:
        database.terrain(name).predict(3.0, 0.05)
        database.terrain(name).slip_risk(3.0, 3.0)


def _script(data: bytes, folder: Path) -> None:
    path = folder / "script.txt"
    path.write_bytes(data)
    ScriptedOperator(path)


def _poses(data: bytes, folder: Path) -> None:
    path = folder / "poses.toml"
    path.write_bytes(data)
    settings = load_settings(None)
    read_poses(path, settings, settings.matrix.terrains[0], range(3, 61))


def _presses(data: bytes, folder: Path) -> None:
    path = folder / "presses.txt"
    path.write_bytes(data)
    read_script(path)


def _bus_log(data: bytes, _: Path) -> None:
    reader = BusReader()
    problems: list[CanLogError] = []
    text = data.decode(errors="replace")
    for frame in parse_log(text.splitlines(), problems.append):
        reader.read(frame)
    reader.finish()
    if problems:
        raise problems[0]


def _frames(data: bytes, _: Path) -> None:
    """Decode `data` as frames of every length with every decoder."""
    for start in range(0, len(data), 10):
        split_id(int.from_bytes(data[start : start + 2], "little") & 0x7FF)
        for decode in _DECODERS:
            for size in range(9):
                try:
                    decode(data[start + 2 : start + 2 + size])
                except FrameError:
                    continue


def _sensor(data: bytes, _: Path) -> None:
    """Read `data` in chunks as a stream of each sensor kind, with timestamps."""
    scanners = (
        bota.scanner(_RANGES),
        robotous.scanner(lambda: 1000.0),
        optoforce.scanner(_RANGES),
        ati.RdtScanner(_RANGES, _RANGES),
    )
    for scanner in scanners:
        timestamper = SampleTimestamper(_TIMING)
        for at_ns, start in enumerate(range(0, len(data), 23)):
            readings = scanner.feed(data[start : start + 23])
            timestamper.date(readings, at_ns * 1_000_000, 0)
    bota.find_boot_text(data)
    bota.find_acknowledgements(data)
    robotous.find_answer(data, 1)
    optoforce.find_configuration_answer(data)
    optoforce.find_serial_number(data)


def _trial(data: bytes, folder: Path) -> None:
    """Read, verify and recover `data` as a trial file."""
    path = folder / "T01.mcap"
    path.write_bytes(data)
    for read in (TrialReader.cycles, TrialReader.topic_counts):
        with contextlib.suppress(TrialFileError):
            read(TrialReader(path))
    recovery = recover_file(path)
    TrialReader(recovery.path).cycles()


def _session_commands(name: str) -> Callable[[bytes, Path], None]:
    """Return a reader that runs commands on a session with its bytes as `name`."""
    return lambda data, folder: run_commands(name, data, folder)


READERS: dict[str, Callable[[bytes, Path], None]] = {
    "journal": lambda data, folder: _session(folder, "events.jsonl", data),
    "session": lambda data, folder: _session(folder, "session.json", data),
    "sidecar": lambda data, folder: _session(folder, "trials/T01.json", data),
    "partial": lambda data, folder: _session(
        folder, "trials/T01.mcap.partial", data, journal_of(*EVENTS)
    ),
    "rig": _settings("rig.toml"),
    "matrix": _settings("matrix.toml"),
    "gravity": _text(lambda text: gravity_from_toml(text, "gravity.toml")),
    "friction": _text(_compensate),
    "foot": _text(payload_from_toml),
    "terrain": _text(terrain_from_toml),
    "sensor-calibration": _text(lambda text: sensor_from_toml(text, "sensor.toml")),
    "database": _database,
    "table": _table("trial.csv"),
    "german-table": _table("trial.csv", separator=";", decimal=","),
    "preamble-table": _table("trial.csv", skipped=frozenset({1, 2, 3, 4, 6})),
    "iso-table": _table("trial.txt", separator="\t"),
    "npz": _table("trials.npz"),
    "parquet": _table("trial.parquet"),
    "package": _package,
    "sums": _sums,
    "results": _results,
    "script": _script,
    "poses": _poses,
    "presses": _presses,
    "bus-log": _bus_log,
    "frames": _frames,
    "sensor": _sensor,
    "mcap": _trial,
    "arm-model": _text(load_constants),
    "lock": lambda data, folder: _session(folder, ".lock", data),
    "used-sidecar": _session_commands("trials/T01.json"),
    "used-rejected": _session_commands("rejected/T01a.json"),
    "used-session": _session_commands("/session.json"),
    "used-journal": _session_commands("/events.jsonl"),
    "used-mcap": _session_commands("trials/T01.mcap"),
    "journal-lines": check_lines,
    "session-names": check_names,
    "log-bag": log_reader("log.bag"),
    "log-mcap": log_reader("log.mcap"),
    "log-db3": log_reader("log.db3"),
    "urdf": read_urdf_bytes,
    "message": read_message,
    "import-record": read_import_record,
}
RESULTS = """\
terrain,model,fold,quantity,value,unit
TF,tustin,1,mae,0.5,N
TF,gp_se,1,nlpd,nan,log N
"""
_FIRST_ATTEMPT = {"trial": 1, "attempt": 1}
EVENTS = (
    {"event": "session-started", "terrain": "TF", "trials": 2},
    {"event": "activated"},
    {"event": "trial-started", **_FIRST_ATTEMPT},
)


def journal_of(*events: dict[str, object]) -> bytes:
    """Return the journal of `events` as bytes."""
    return b"".join(journal_line(event, n) for n, event in enumerate(events, 1))
