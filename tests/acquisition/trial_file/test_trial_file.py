import hashlib
import io
import itertools
import os
import stat
import struct

import mcap.reader
import numpy as np
import pytest
from mcap.writer import Writer

from acquisition.errors import TrialFileError
from acquisition.ipc.frame_ring import FRAME_DTYPE
from acquisition.ipc.shared_sensor import WRENCH_DTYPE
from acquisition.recording.recorder import seal
from acquisition.sample import CHANNELS, Flag
from acquisition.schema import TRUTH
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.verify import verify_file
from acquisition.trial_file.writer import (
    FLIGHT_TOPICS,
    TRUTH_TOPICS,
    TrialWriter,
    publish,
)
from tests.acquisition.ros import decode, messages_of
from tests.acquisition.trials import (
    ATTACHMENTS,
    OFFSET_NS,
    PERIOD_NS,
    START_NS,
    make_cycles,
    make_header,
    span_of,
    spans,
    write_trial,
)

MESSAGE_OPCODES = {5, 6}
METADATA, ATTACHMENT = 12, 9


@pytest.fixture(scope="module")
def cycles():
    return make_cycles(600, skipped=(1100, 1101, 1300))


@pytest.fixture(scope="module")
def trial(tmp_path_factory, cycles):
    path = tmp_path_factory.mktemp("trial") / "T01.mcap"
    writer = write_trial(path, cycles)
    writer.write_event(START_NS + 9, 20, "operator", "mark")
    seal(writer, "travel")
    return path


@pytest.fixture(scope="module")
def reader(trial):
    return TrialReader(trial)


def test_cycles_round_trip_bit_for_bit(reader, cycles):
    data = reader.cycles().data
    names = [name for name in data.dtype.names if name not in {"sec", "nanosec"}]
    for name in names:
        assert data[name].tobytes() == cycles[name].tobytes(), name


def test_cycles_are_bit_identical_when_read_by_rosbags(trial, reader):
    rows = reader.cycles()
    theirs = messages_of(trial)["/cycle"]
    assert rows.data.tobytes() == b"".join(data for _, data in theirs)
    assert rows.log_time.tolist() == [time for time, _ in theirs]


def test_every_topic_is_readable_by_rosbags(trial, reader):
    theirs = messages_of(trial)
    counts = {topic: len(messages) for topic, messages in theirs.items()}
    assert counts == reader.topic_counts()
    assert counts["/cycle"] == 600
    assert decode("rcl_interfaces/msg/Log", theirs["/events"][0][1]).msg == "mark"
    description = decode("std_msgs/msg/String", theirs["/robot_description"][0][1])
    assert description.data == "<robot name='wam7'/>"


def test_times_follow_one_offset(reader, cycles):
    rows = reader.cycles()
    assert np.array_equal(rows.log_time, cycles["host_ns"] + np.uint64(OFFSET_NS))
    stamps = rows.data["sec"].astype(np.int64) * 10**9 + rows.data["nanosec"]
    assert np.array_equal(stamps, rows.log_time.astype(np.int64))


def test_the_rate_is_nominal_if_no_cycle_is_missed(reader):
    rows = reader.cycles()
    steps = np.diff(rows.data["cycle"].astype(np.int64))
    assert set(np.diff(rows.log_time.astype(np.int64)) / steps) == {PERIOD_NS}


def test_sequence_is_the_cycle_number(reader):
    rows = reader.cycles()
    assert np.array_equal(rows.sequence, rows.data["cycle"])


def test_publish_time_is_when_the_replies_arrived(trial, cycles):
    with trial.open("rb") as file:
        messages = mcap.reader.make_reader(file).iter_messages("/cycle")
        published = [message.publish_time for _, _, message in messages]
    assert published == (cycles["arm_ns"].astype(np.int64) + OFFSET_NS).tolist()


def test_publish_time_is_the_log_time_without_replies(tmp_path):
    cycles = make_cycles(4)
    cycles["arm_ns"][2] = 0
    seal(write_trial(tmp_path / "T.mcap", cycles), "end")
    with (tmp_path / "T.mcap").open("rb") as file:
        messages = list(mcap.reader.make_reader(file).iter_messages("/cycle"))
    assert [m.publish_time - m.log_time for _, _, m in messages] == [
        700_000,
        700_000,
        0,
        700_000,
    ]


def test_views_have_the_time_and_number_of_their_cycle(trial, cycles):
    shown = cycles[cycles["cycle"] % 10 == 0]
    with trial.open("rb") as file:
        messages = mcap.reader.make_reader(file).iter_messages("/joint_states")
        found = [(m.log_time, m.sequence) for _, _, m in messages]
    times = shown["host_ns"].astype(np.int64) + OFFSET_NS
    assert found == list(zip(times.tolist(), shown["cycle"].tolist(), strict=True))


@pytest.mark.parametrize(("every", "views"), [(0, 0), (1, 50), (7, 8)])
def test_the_rate_of_the_views_is_a_setting(tmp_path, every, views):
    header = make_header(views_every=every)
    cycles = make_cycles(50, first=0)
    seal(write_trial(tmp_path / "T.mcap", cycles, header), "end")
    assert TrialReader(tmp_path / "T.mcap").topic_counts()["/wrench"] == views


def test_descriptions_precede_messages_and_the_result_follows(trial):
    data = trial.read_bytes()
    order = [span.opcode for span in spans(data)]
    first = min(i for i, opcode in enumerate(order) if opcode in MESSAGE_OPCODES)
    last = max(i for i, opcode in enumerate(order) if opcode in MESSAGE_OPCODES)
    assert order[:first].count(METADATA) == 2 * 4  # before the attachments and after
    assert order[:first].count(ATTACHMENT) == len(ATTACHMENTS)
    assert order[last:].count(METADATA) == 1
    assert b"result" in data[span_of(data, METADATA, 8).start :][:20]


def test_attachments_come_back_with_their_digests(reader):
    assert reader.attachments == ATTACHMENTS
    for name, content in ATTACHMENTS.items():
        digest = hashlib.sha256(content).hexdigest()
        assert reader.metadata["provenance"][f"sha256:{name}"] == digest


def test_metadata_describe_the_recording(reader):
    assert reader.metadata["trial"]["format_version"] == "1.0"
    assert reader.metadata["trial"]["session"] == "S"
    assert reader.metadata["clock"] == {
        "utc_offset_ns": str(OFFSET_NS),
        "offset_uncertainty_ns": "80",
        "rate_hz": "500",
    }
    assert set(reader.metadata["channels"]) == {c.field for c in CHANNELS}
    assert reader.is_simulated
    assert reader.is_complete


def test_missing_cycles_are_counted(reader):
    result = reader.metadata["result"]
    assert result["cycles_written"] == "600"
    assert result["cycles_missed"] == "3"
    assert result["cycles_expected"] == "603"
    assert result["stop_reason"] == "travel"


def test_late_cycles_are_counted(tmp_path):
    cycles = make_cycles(20)
    cycles["flags"][[3, 4, 9]] |= np.uint32(Flag.DEADLINE_MISSED)
    seal(write_trial(tmp_path / "T.mcap", cycles), "end")
    result = TrialReader(tmp_path / "T.mcap").metadata["result"]
    assert result["late_cycles"] == "3"


def test_a_gap_between_two_blocks_is_counted(tmp_path):
    writer = write_trial(tmp_path / "T.mcap", make_cycles(30, skipped=(1010,)), block=5)
    assert writer.counts.missed == 1
    writer.close_partial()


def test_verify_reports_size_digest_and_cadence(trial):
    verified = verify_file(trial)
    content = trial.read_bytes()
    assert verified.sha256 == hashlib.sha256(content).hexdigest()
    assert (verified.size, verified.cycles) == (len(content), 600)
    assert verified.duration == pytest.approx(602 * 0.002, abs=1e-12)  # exact grid
    assert verified.worst_gap == pytest.approx(0.006, abs=1e-12)


def test_two_equal_recordings_are_equal_files(tmp_path, cycles):
    digests = set()
    for name in ("a", "b"):
        seal(write_trial(tmp_path / f"{name}.mcap", cycles), "end")
        digests.add(hashlib.sha256((tmp_path / f"{name}.mcap").read_bytes()).digest())
    assert len(digests) == 1


def test_the_published_file_is_read_only(trial):
    assert stat.S_IMODE(trial.stat().st_mode) == 0o444
    assert list(trial.parent.iterdir()) == [trial]


def test_an_existing_trial_is_never_written_again(tmp_path):
    path = tmp_path / "T.mcap"
    path.write_bytes(b"a good trial")
    with pytest.raises(TrialFileError, match="never overwritten"):
        TrialWriter(path, make_header())
    assert path.read_bytes() == b"a good trial"
    assert list(tmp_path.iterdir()) == [path]


def test_an_existing_partial_is_never_touched(tmp_path):
    partial = tmp_path / "T.mcap.partial"
    partial.write_bytes(b"to be recovered")
    with pytest.raises(TrialFileError, match="File exists"):
        TrialWriter(tmp_path / "T.mcap", make_header())
    assert partial.read_bytes() == b"to be recovered"


def test_publishing_never_replaces_a_file(tmp_path):
    path = tmp_path / "T.mcap"
    writer = write_trial(path, make_cycles(10))
    writer.finish("end")
    path.write_bytes(b"came in between")
    with pytest.raises(TrialFileError, match="File exists"):
        publish(writer)
    assert path.read_bytes() == b"came in between"
    assert verify_file(writer.partial, writer.counts).cycles == 10


def test_a_missing_folder_is_reported(tmp_path):
    with pytest.raises(TrialFileError, match="No such file"):
        TrialWriter(tmp_path / "nowhere" / "T.mcap", make_header())


def test_a_file_left_behind_by_a_kill_asks_for_recovery(tmp_path, cycles):
    writer = write_trial(tmp_path / "T.mcap", cycles)
    writer.close_partial()
    with pytest.raises(TrialFileError, match="cut off") as caught:
        TrialReader(writer.partial)
    assert "traction recover" in caught.value.hint


def test_flushed_data_survive_a_kill(tmp_path, cycles):
    writer = write_trial(tmp_path / "T.mcap", cycles)
    on_disk = writer.partial.read_bytes()
    writer.close_partial()
    stream = mcap.reader.NonSeekingReader(io.BytesIO(on_disk))
    messages = stream.iter_messages("/cycle", log_time_order=False)
    kept = [m.sequence for _, _, m in itertools.islice(messages, len(cycles))]
    assert kept == cycles["cycle"].tolist()


def test_sensor_samples_keep_their_own_times(tmp_path):
    writer = write_trial(tmp_path / "T.mcap", make_cycles(10))
    samples = np.zeros(3, WRENCH_DTYPE)
    samples["t_ns"] = START_NS + np.arange(3)
    samples["counter"] = samples["status"] = samples["wrench"][:, 0] = np.arange(3)
    writer.write_wrenches(samples)
    writer.write_wrenches(samples[:0])
    seal(writer, "end")
    ((time, payload),) = messages_of(tmp_path / "T.mcap")["/ft/raw"]
    batch = decode("traction_msgs/msg/WrenchBatch", payload)
    assert time == START_NS + 2 + OFFSET_NS
    assert batch.t_ns.tolist() == [START_NS, START_NS + 1, START_NS + 2]
    assert batch.counter.tolist() == [0, 1, 2]
    assert batch.status.tolist() == [0, 1, 2]
    assert batch.wrench_raw.reshape(3, 6)[:, 0].tolist() == [0, 1, 2]


def test_a_flight_record_keeps_raw_frames(tmp_path):
    writer = TrialWriter(tmp_path / "F.mcap", make_header(), FLIGHT_TOPICS)
    writer.write_cycles(make_cycles(10))
    frames = np.zeros(2, FRAME_DTYPE)
    frames["t_ns"] = START_NS, START_NS + 5
    writer.write_can(frames)
    seal(writer, "fault")
    ((time, payload),) = messages_of(tmp_path / "F.mcap")["/can/raw"]
    batch = decode("traction_msgs/msg/CanBatch", payload)
    assert time == START_NS + 5 + OFFSET_NS
    assert batch.t_ns.tolist() == [START_NS, START_NS + 5]


def test_a_truth_file_holds_only_the_truth(tmp_path):
    truth = np.frombuffer(bytearray(TRUTH.template * 5), TRUTH.dtype)
    truth["host_ns"] = START_NS + PERIOD_NS * np.arange(5)
    truth["contact_force"] = np.arange(15).reshape(5, 3)
    writer = TrialWriter(tmp_path / "T.truth.mcap", make_header(), TRUTH_TOPICS)
    writer.write_truth(truth)
    assert seal(writer, "simulation").cycles == 0
    reader = TrialReader(tmp_path / "T.truth.mcap")
    assert reader.topic_counts() == {"/truth": 5}
    rows = reader.truth()
    assert rows.data["contact_force"].tobytes() == truth["contact_force"].tobytes()


def test_a_truth_file_has_no_cycles(tmp_path):
    truth = np.frombuffer(bytearray(TRUTH.template * 2), TRUTH.dtype)
    writer = TrialWriter(tmp_path / "T.truth.mcap", make_header(), TRUTH_TOPICS)
    writer.write_truth(truth)
    seal(writer, "simulation")
    with pytest.raises(TrialFileError, match="no topic /cycle"):
        TrialReader(tmp_path / "T.truth.mcap").cycles()


def sealed_anyway(tmp_path, cycles, **changes):
    """Return a finished file that `verify_file` has to judge."""
    writer = write_trial(tmp_path / "T.mcap", cycles, make_header(**changes))
    writer.finish("end")
    return writer


def test_verify_refuses_a_wrong_cadence(tmp_path):
    cycles = make_cycles(50)
    cycles["host_ns"] = START_NS + 1_030_000 * 2 * np.arange(50)  # 3 % slow
    with pytest.raises(TrialFileError, match=r"2\.060 ms"):
        verify_file(sealed_anyway(tmp_path, cycles).partial)


def test_verify_accepts_a_cadence_within_the_tolerance(tmp_path):
    cycles = make_cycles(50)
    cycles["host_ns"] = START_NS + 1_009_000 * 2 * np.arange(50)  # 0.9 % slow
    assert verify_file(sealed_anyway(tmp_path, cycles).partial).cycles == 50


def test_verify_refuses_cycles_out_of_order(tmp_path):
    cycles = make_cycles(50)
    cycles["cycle"][[10, 11]] = cycles["cycle"][[11, 10]]
    with pytest.raises(TrialFileError, match="out of order"):
        verify_file(sealed_anyway(tmp_path, cycles).partial)


def test_verify_refuses_a_repeated_cycle(tmp_path):
    cycles = make_cycles(50)
    cycles["cycle"][11] = cycles["cycle"][10]
    with pytest.raises(TrialFileError, match="out of order"):
        verify_file(sealed_anyway(tmp_path, cycles).partial)


def test_verify_refuses_fewer_than_two_cycles(tmp_path):
    with pytest.raises(TrialFileError, match="fewer than two"):
        verify_file(sealed_anyway(tmp_path, make_cycles(1)).partial)


def test_verify_refuses_changed_messages(tmp_path):
    writer = sealed_anyway(tmp_path, make_cycles(20))
    writer.counts.messages["/events"] = 1
    with pytest.raises(TrialFileError, match="other messages"):
        verify_file(writer.partial, writer.counts)


@pytest.mark.parametrize("name", ["trial", "clock", "provenance", "channels", "result"])
def test_verify_requires_every_metadata_record(tmp_path, monkeypatch, name):
    add = Writer.add_metadata

    def forgetful(self, record, data):
        if record != name:
            add(self, record, data)

    monkeypatch.setattr(Writer, "add_metadata", forgetful)
    writer = sealed_anyway(tmp_path, make_cycles(10))
    with pytest.raises(TrialFileError, match=f"metadata {name}|no trial of Traction"):
        verify_file(writer.partial)


def test_verify_requires_every_attachment_unchanged(tmp_path, monkeypatch):
    add = Writer.add_attachment

    def careless(self, created, logged, name, media_type, data):
        add(self, created, logged, name, media_type, data[:-1])

    monkeypatch.setattr(Writer, "add_attachment", careless)
    writer = sealed_anyway(tmp_path, make_cycles(10))
    with pytest.raises(TrialFileError, match=r"no sound attachment config\.toml"):
        verify_file(writer.partial)


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [
        ("clock", "utc_offset_ns", "soon"),
        ("clock", "utc_offset_ns", None),
        ("result", "cycles_written", "many"),
        ("result", "cycles_missed", None),
        ("result", "cycles_missed", "1"),
        ("result", "cycles_written", "11"),
        ("clock", "utc_offset_ns", "0"),
    ],
)
def test_verify_reports_invalid_metadata(tmp_path, monkeypatch, name, key, value):
    add = Writer.add_metadata

    def lying(self, record, data):
        if record == name:
            data = {k: v for k, v in data.items() if k != key}
            data |= {} if value is None else {key: value}
        add(self, record, data)

    monkeypatch.setattr(Writer, "add_metadata", lying)
    writer = sealed_anyway(tmp_path, make_cycles(10))
    with pytest.raises(TrialFileError):
        verify_file(writer.partial)


def test_a_full_disk_keeps_the_partial_file_with_a_recovery_hint(tmp_path, monkeypatch):
    writer = write_trial(tmp_path / "T.mcap", make_cycles(200))
    kept = writer.partial.stat().st_size

    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(TrialFileError, match="No space left") as caught:
        writer.flush()
    assert "traction recover" in caught.value.hint
    assert writer.partial.stat().st_size >= kept
    with pytest.raises(TrialFileError, match="closed"):
        writer.flush()


_FSYNCS = 6  # of a trial that is flushed once, finished and published


@pytest.mark.parametrize("number", [None, *range(_FSYNCS)])
def test_no_fsync_failure_is_silent(tmp_path, monkeypatch, number):
    usual, calls = os.fsync, []

    def fsync(descriptor):
        calls.append(descriptor)
        if len(calls) - 1 == number:
            raise OSError(5, "Input/output error")
        usual(descriptor)

    def record():
        writer = write_trial(tmp_path / "T.mcap", make_cycles(50))
        writer.flush()
        seal(writer, "end")

    monkeypatch.setattr("os.fsync", fsync)
    if number is None:
        record()
        assert len(calls) == _FSYNCS
    else:
        with pytest.raises(TrialFileError, match="Input/output error"):
            record()
        assert len(calls) == number + 1


def test_an_unusual_note_does_not_end_the_recording(tmp_path):
    writer = write_trial(tmp_path / "T.mcap", make_cycles(10))
    writer.write_event(START_NS, 20, "operator", "broken \udc80 key")
    assert seal(writer, "end").cycles == 10


def test_a_chunk_is_closed_by_every_flush(trial, cycles):
    chunks = [span for span in spans(trial.read_bytes()) if span.opcode == 6]
    assert len(chunks) == -(-len(cycles) // 125) + 1  # the event came after the last


def test_the_stored_chunks_have_checksums(trial):
    data = trial.read_bytes()
    chunk = span_of(data, 6)
    crc = struct.unpack_from("<I", data, chunk.body + 24)[0]
    assert crc != 0
