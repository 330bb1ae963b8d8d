"""A file of another version is refused with a message that names both versions."""

import json
import shutil

import pytest

from acquisition.errors import TractionError
from acquisition.formats import FORMAT
from acquisition.recording.recorder import seal
from acquisition.trial_file import writer
from acquisition.trial_file.reader import TrialReader
from analysis.tables.loading import load_tables
from analysis.terrains.database import load
from experiments.commissioning.evidence.daily_record import read_history
from experiments.commissioning.evidence.record import read_commissioning
from experiments.session.data_files import journal_line, write_json
from experiments.session.store import list_sessions
from experiments.settings.load import load_settings
from ft_sensor.calibration.files import payload_from_toml, terrain_from_toml
from ft_sensor.calibration.sensor_file import sensor_from_toml
from tests.acquisition.trials import make_cycles, write_trial
from tests.corpus.samples import samples
from tests.corpus.used_session import lay_out
from tests.experiments.program import traction, write_config
from wam.calibration.friction_file import friction_from_toml
from wam.calibration.gravity_file import gravity_from_toml

OTHER = "2.7"
CALIBRATIONS = {
    "gravity": lambda text: gravity_from_toml(text, "gravity.toml"),
    "friction": lambda text: friction_from_toml(text, "friction.toml"),
    "sensor-calibration": lambda text: sensor_from_toml(text, "sensor.toml"),
    "foot": payload_from_toml,
    "terrain": terrain_from_toml,
}


def refused(read):
    with pytest.raises(TractionError) as raised:
        read()
    message = raised.value.message
    assert OTHER in message, message
    assert FORMAT in message, message


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_a_calibration_of_another_version_is_refused(name):
    text = samples()[name].decode()
    CALIBRATIONS[name](text)
    line = f'version = "{FORMAT}"\n'
    assert text.count(line) == 1
    refused(lambda: CALIBRATIONS[name](text.replace(line, f'version = "{OTHER}"\n')))
    with pytest.raises(TractionError, match="states no version"):
        CALIBRATIONS[name](text.replace(line, ""))


def test_a_matrix_of_another_version_is_refused(tmp_path):
    line = f'version = "{FORMAT}"'
    config = write_config(tmp_path, matrix=(line, f'version = "{OTHER}"'))
    refused(lambda: load_settings(config))


def test_a_rig_of_another_version_is_refused(tmp_path):
    line = f'version = "{FORMAT}"'
    config = write_config(tmp_path, rig=(line, f'version = "{OTHER}"'))
    refused(lambda: load_settings(config))


def test_a_trial_of_another_version_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "FORMAT", OTHER)
    path = tmp_path / "T01.mcap"
    with pytest.raises(TractionError):  # it is read back before it gets its name
        seal(write_trial(path, make_cycles(50)), "travel")
    shutil.move(path.with_name("T01.mcap.partial"), path)
    refused(lambda: TrialReader(path))


def test_a_session_of_another_version_is_refused_and_named(tmp_path, monkeypatch):
    lay_out(tmp_path)
    (session,) = list_sessions(tmp_path)
    journal = session.path / "events.jsonl"
    first, rest = journal.read_bytes().split(b"\n", 1)
    event = {k: v for k, v in json.loads(first).items() if k not in {"crc", "line"}}
    monkeypatch.setattr("experiments.session.data_files.FORMAT", OTHER)
    line = journal_line(event, 1)
    monkeypatch.undo()
    journal.write_bytes(line + rest)
    refused(session.events)
    for command in (("status",), ("verify", "S001"), ("report", "S001")):
        done = traction(*command, "--data", tmp_path)
        assert done.code != 0
        assert f"is of version {OTHER!r}" in done.err, done


def test_a_terrain_database_of_another_version_is_refused(tmp_path):
    content = json.loads(samples()["database"])
    path = tmp_path / "terrains.json"
    path.write_text(json.dumps({**content, "version": OTHER}))
    refused(lambda: load(path))


def test_tables_of_another_version_are_refused(recorded, tmp_path):
    to = tmp_path / "tables"
    assert traction("export", "S001", "--to", to, "--data", recorded.data).code == 0
    load_tables([to])
    package = to / "datapackage.json"
    content = json.loads(package.read_text())
    assert content["version"] == FORMAT
    package.write_text(json.dumps({**content, "version": OTHER}))
    refused(lambda: load_tables([to]))


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("commissioning.json", read_commissioning),
        ("daily.json", lambda to: read_history(to, is_simulated=False)),
    ],
)
def test_a_commissioning_of_another_version_is_refused(tmp_path, name, read):
    write_json(tmp_path / name, {"version": OTHER, "program": "x"})
    with pytest.raises(TractionError, match=FORMAT):
        read(tmp_path)
