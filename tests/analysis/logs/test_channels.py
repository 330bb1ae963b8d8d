"""Unusable messages are counted and named, never repaired."""

import sqlite3

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.logs.importing import import_log
from analysis.logs.opening import log_files, open_log
from tests.analysis.logs.gantry import StrokeLog, import_request, write_bag2, write_urdf

WRENCH = "/ft/wrench"


@pytest.fixture
def imported(tmp_path):
    urdf = write_urdf(tmp_path)

    def make(stroke_log, **options):
        log = tmp_path / "log"
        if not log.exists():
            write_bag2(log, stroke_log)
        return import_log(import_request(stroke_log, log, urdf, **options))

    return make


def changing(topic, change):
    """Return a change of the messages of a topic: change(number, message)."""

    def changed(rows):
        count = 0
        for name, _, message in rows:
            if name == topic:
                change(count, message)
                count += 1
        return rows

    return (changed,)


def worst_F_n(found, stroke_log):
    (trial,) = found.trials
    v_t, _, F_n = stroke_log.truth(trial.t + trial.start)
    sound = np.isfinite(trial.traction[:, 2]) & (v_t > 0.03)
    return float(np.abs(trial.traction[:, 2] - F_n)[sound].max())


def test_nan_velocities_leave_positions_usable(imported):
    def change(_, message):
        message.velocity[:] = np.nan

    stroke_log = StrokeLog(
        with_velocity=True, changes=changing("/joint_states", change)
    )
    found = imported(stroke_log)
    assert len(found.joints.q) == 1500
    assert any("1500 messages with invalid velocities" in w for w in found.warnings)
    assert found.trials[0].traction[:, 0].max() == pytest.approx(0.06, abs=1e-3)


@pytest.mark.parametrize("rows", [(775,), (775, 776, 1000)])
def test_joint_states_of_zeros_are_reported_and_omitted(imported, rows):
    def change(count, message):
        if count in rows:
            message.position[:] = 0.0

    stroke_log = StrokeLog(changes=changing("/joint_states", change))
    found = imported(stroke_log)
    assert any(
        f"{len(rows)} messages with all joints at zero" in w and "6.200" in w
        for w in found.warnings
    )
    assert found.trials[0].traction[:, 0].max() == pytest.approx(0.06, abs=1e-3)
    assert worst_F_n(found, stroke_log) < 0.3


def test_joints_resting_at_zero_are_accepted(imported):
    stroke_log = StrokeLog()
    real = stroke_log.joints

    def at_zero(t):
        q = real(t)
        return q - q[0]

    stroke_log.joints = at_zero
    found = imported(stroke_log)
    assert not any("at zero" in w for w in found.warnings)


def test_a_jump_of_a_joint_is_refused_with_its_time(imported):
    def change(count, message):
        if count >= 775:
            message.position[0] += 0.5

    stroke_log = StrokeLog(changes=changing("/joint_states", change))
    with pytest.raises(SettingsError, match=r"jumps 6\.192 s after its first message"):
        imported(stroke_log)


def test_a_constant_channel_is_omitted_and_reported(imported):
    held = []

    def change(count, message):
        if 1000 <= count < 1500:
            held.append(message.wrench)
            message.wrench.force = held[0].force
            message.wrench.torque = held[0].torque

    stroke_log = StrokeLog(changes=changing(WRENCH, change))
    found = imported(stroke_log)
    assert any("unchanged reading for 2.50 s from 5.01" in w for w in found.warnings)
    assert worst_F_n(found, stroke_log) < 0.3
    (trial,) = found.trials
    at = trial.t + trial.start
    assert np.isnan(trial.traction[(at > 5.05) & (at < 7.4), 1]).all()


def test_nan_readings_are_counted(imported):
    def change(count, message):
        if count % 7 == 3:
            message.wrench.force.x = np.nan

    stroke_log = StrokeLog(changes=changing(WRENCH, change))
    found = imported(stroke_log)
    text = "2400 messages, 2057 used; left out: 343 with invalid readings"
    assert found.wrench.clock.text == text
    assert any(text in w for w in found.warnings)
    assert worst_F_n(found, stroke_log) < 0.3


def test_without_usable_messages_the_causes_are_counted(imported):
    def change(_, message):
        message.position[:] = np.nan

    stroke_log = StrokeLog(changes=changing("/joint_states", change))
    with pytest.raises(
        SettingsError,
        match=r"0 usable messages of 1500 .* \(1500 with invalid positions",
    ):
        imported(stroke_log)


@pytest.mark.parametrize("clock", [None, "receipt"])
def test_a_duplicated_recording_is_reported(imported, tmp_path, clock):
    imported(StrokeLog())
    (file,) = (tmp_path / "log").glob("*.mcap")
    file.with_name("copy.mcap").write_bytes(file.read_bytes())
    with pytest.raises(SettingsError, match=r"copy.mcap and log.mcap hold the same"):
        imported(StrokeLog(), clock=clock)


def database(tmp_path):
    """Return the file of a recording as rosbag2 writes it."""
    write_bag2(
        tmp_path / "db3", StrokeLog(joint_rate=100.0, wrench_rate=100.0), "SQLITE3"
    )
    return next((tmp_path / "db3").glob("*.db3"))


def counted(path):
    with open_log(path) as log:
        return sum(1 for _ in log.messages(log.topics)), log.losses


def test_messages_in_a_write_ahead_log_are_read(tmp_path):
    path = database(tmp_path)
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA journal_mode=WAL")
    connection.execute("PRAGMA wal_autocheckpoint=0")
    with connection:
        connection.execute(
            "INSERT INTO messages (topic_id, timestamp, data) "
            "SELECT topic_id, timestamp + 1, data FROM messages LIMIT 100"
        )
    crashed = tmp_path / "crashed"
    crashed.mkdir()
    names = (path.name, f"{path.name}-wal")
    for name in names:
        (crashed / name).write_bytes(path.with_name(name).read_bytes())
    connection.close()
    before = {name: (crashed / name).read_bytes() for name in names}
    assert counted(crashed / path.name) == (2500, [])
    assert [file.name for file in log_files(crashed)] == [*names]
    assert {p.name: p.read_bytes() for p in crashed.iterdir()} == before


def test_a_hot_journal_is_refused_by_its_name(tmp_path):
    path = database(tmp_path)
    journal = path.with_name(f"{path.name}-journal")
    journal.write_bytes(b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7" + bytes(504))
    with pytest.raises(SettingsError, match=rf"{journal.name} shows a transaction"):
        counted(path)
    assert journal.exists()
    journal.write_bytes(bytes(512))  # as SQLite leaves it where it keeps journals
    assert counted(path) == (2400, [])
    journal.write_bytes(b"")
    assert counted(path) == (2400, [])


def test_a_damaged_write_ahead_log_loses_only_its_own_messages(tmp_path):
    path = database(tmp_path)
    path.with_name(f"{path.name}-wal").write_bytes(b"\x37\x7f\x06\x82" + bytes(5000))
    assert counted(path) == (2400, [])
