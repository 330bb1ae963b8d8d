import json
import re
import stat

import numpy as np
import pytest

from acquisition.sample import SAFETY_MODE_MASK, Flag
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.verify import verify_file
from acquisition.trial_file.writer import TRIAL_TOPICS
from experiments.session.reducer import replay
from tests.acquisition.ros import decode, messages_of
from tests.experiments.program import TRAVEL, digest, journal, sidecar

SESSION_FILES = {
    "session.json",
    "events.jsonl",
    "config.toml",
    "matrix.toml",
    "preflight.json",
    "provenance.json",
    "diff.patch",
    "conditions.json",
    ".lock",
}
TRIAL_FILES = {
    f"T0{number}{suffix}"
    for number in (1, 2)
    for suffix in (".mcap", ".truth.mcap", ".json")
}


@pytest.fixture(scope="module")
def cycles(first_trial):
    return TrialReader(first_trial).cycles()


def test_a_complete_session_ends_without_an_error(recorded):
    assert recorded.done.code == 0
    assert recorded.done.err == ""
    assert "ARM: idle; it sinks slowly, support it." in recorded.done.out


def test_a_complete_session_names_the_next_command(recorded):
    *_, next_step, _, _ = recorded.done.out.splitlines()
    assert next_step == f"Complete. Next: traction report S001 --data {recorded.data}"


def test_the_folder_name_marks_a_simulated_session(recorded):
    assert re.fullmatch(r"\d{4}-\d\d-\d\d_S001_TF\.fake", recorded.folder.name)


def test_the_folder_holds_exactly_the_expected_files(recorded):
    folder = recorded.folder
    files = {path.name for path in folder.iterdir() if path.is_file()}
    assert files == SESSION_FILES
    assert {path.name for path in (folder / "trials").iterdir()} == TRIAL_FILES
    assert list((folder / "rejected").iterdir()) == []
    assert list((folder / "faults").iterdir()) == []


def test_the_settings_of_a_session_are_copied_byte_for_byte(recorded, config):
    for name, kept in (("rig.toml", "config.toml"), ("matrix.toml", "matrix.toml")):
        text = config.with_name(name).read_bytes()
        assert (recorded.folder / kept).read_bytes() == text


def test_the_replayed_journal_agrees_with_session_json(recorded):
    state = replay(journal(recorded.folder))
    fields = json.loads((recorded.folder / "session.json").read_text())
    assert (
        fields["kept"] == [f"T{number:02d}" for number in state.kept] == ["T01", "T02"]
    )
    assert (fields["terrain"], fields["trials"]) == (state.terrain, state.wanted)
    assert (fields["rejected"], fields["ended"]) == (state.rejected, state.ended)
    assert state.ended == "complete"


def test_a_sidecar_has_verdict_checksum_and_author(recorded):
    for name in ("T01", "T02"):
        path = recorded.folder / "trials" / f"{name}.mcap"
        fields = sidecar(path)
        assert fields["sha256"] == digest(path)
        assert fields["size"] == path.stat().st_size
        assert (fields["verdict"], fields["status"]) == ("keep", "complete")
        assert (fields["who"], fields["stop_reason"]) == ("auto", "travel")


def test_trial_files_are_read_only(recorded):
    for path in (recorded.folder / "trials").glob("*.mcap"):
        assert stat.S_IMODE(path.stat().st_mode) == 0o444


def test_trial_files_pass_a_second_verification(recorded):
    for path in (recorded.folder / "trials").glob("*.mcap"):
        assert verify_file(path).sha256 == digest(path)


def test_the_loop_ran_at_its_rate_without_a_gap(cycles):
    assert set(np.diff(cycles.data["cycle"].astype(int)).tolist()) == {1}
    assert set(np.diff(cycles.data["host_ns"].astype(int)).tolist()) == {2_000_000}


def test_a_trial_has_all_cycles_of_its_duration_and_the_whole_travel(
    cycles, first_trial
):
    fields = sidecar(first_trial)
    lasted = len(cycles.data) / 500
    assert lasted == pytest.approx(fields["duration"], abs=0.003)  # one period
    assert fields["displacement"] > TRAVEL


def test_every_cycle_is_marked_as_simulated_active_and_fresh(cycles):
    wanted = Flag.SIMULATED | Flag.ARM_FRESH | Flag.JOINT7_LOCKED
    flags = cycles.data["flags"]
    assert bool((flags & wanted == wanted).all())
    assert set((flags & SAFETY_MODE_MASK).tolist()) == {2}


def test_rosbags_finds_every_topic(first_trial):
    messages = messages_of(first_trial)
    assert set(messages) == set(TRIAL_TOPICS)
    assert "/can/raw" not in messages
    assert all(messages.values())


def test_rosbags_reads_the_same_cycles_bit_for_bit(first_trial, cycles):
    theirs = messages_of(first_trial)["/cycle"]
    assert cycles.data.tobytes() == b"".join(payload for _, payload in theirs)
    assert cycles.log_time.tolist() == [time for time, _ in theirs]


def test_joint_states_repeat_the_cycle_of_their_time(first_trial, cycles):
    theirs = messages_of(first_trial)
    row = {int(t): i for i, t in enumerate(cycles.log_time)}
    assert len(theirs["/joint_states"]) == pytest.approx(len(row) / 10, abs=1)
    for time, payload in theirs["/joint_states"][::50]:
        view = decode("sensor_msgs/msg/JointState", payload)
        record = cycles.data[row[time]]
        assert view.position.tolist() == record["position"].tolist()
        assert view.effort.tolist() == record["torque_command"].tolist()


def test_sensor_samples_are_complete_at_their_own_rate(first_trial):
    batches = [
        decode("traction_msgs/msg/WrenchBatch", payload)
        for _, payload in messages_of(first_trial)["/ft/raw"]
    ]
    counter = np.concatenate([batch.counter for batch in batches]).astype(int)
    t_ns = np.concatenate([batch.t_ns for batch in batches]).astype(int)
    # 51200 / 64 = 800 Hz; the device counts whole microseconds, 20 ppm off
    assert np.diff(counter) == pytest.approx(1250, abs=1)
    assert np.diff(t_ns).mean() == pytest.approx(1_250_000, rel=1e-3)


def test_two_trials_of_one_session_differ(recorded):
    first, second = (
        TrialReader(recorded.folder / "trials" / f"{name}.mcap").cycles().data
        for name in ("T01", "T02")
    )
    count = min(len(first), len(second))
    assert bool((first["wrench_raw"][:count] != second["wrench_raw"][:count]).any())
