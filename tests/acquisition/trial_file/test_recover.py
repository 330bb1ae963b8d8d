"""Recovery saves every sound record in a new file, or refuses with an error."""

import errno
import hashlib
import os
import stat
import struct
import zlib

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Message, Metadata

from acquisition.clock import NS_PER_S
from acquisition.errors import TrialFileError
from acquisition.recording.recorder import seal
from acquisition.sample import Flag
from acquisition.schema import CYCLE, TRUTH
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import LostSpan, recover_file, recovered_path
from acquisition.trial_file.salvage import SoundRecords, recorded_seconds
from acquisition.trial_file.verify import verify_file
from acquisition.trial_file.writer import (
    FLIGHT_TOPICS,
    TRIAL_TOPICS,
    TRUTH_TOPICS,
    TrialWriter,
    topics_by_sizes,
)
from tests.acquisition.forged import chunk_content, with_chunk
from tests.acquisition.ros import messages_of
from tests.acquisition.trials import (
    ATTACHMENTS,
    START_NS,
    flipped,
    make_cycles,
    make_header,
    span_of,
    spans,
    write_trial,
)

MESSAGE, MESSAGE_INDEX, CHUNK, ATTACHMENT, METADATA = 5, 7, 6, 9, 12
BLOCK = 50  # cycles in a chunk


def partial_bytes(folder, cycles, block=BLOCK):
    """Return the bytes of a `.partial` that a kill left behind."""
    writer = write_trial(folder / "T01.mcap", cycles, block=block)
    writer.close_partial()
    return writer.partial.read_bytes()


@pytest.fixture(scope="module")
def cycles():
    return make_cycles(300, skipped=(1020, 1021, 1170))


@pytest.fixture(scope="module")
def left(tmp_path_factory, cycles):
    """Return the bytes of a `.partial` of six chunks."""
    return partial_bytes(tmp_path_factory.mktemp("left"), cycles)


@pytest.fixture(scope="module")
def sealed(tmp_path_factory, cycles):
    path = tmp_path_factory.mktemp("sealed") / "T01.mcap"
    seal(write_trial(path, cycles, block=BLOCK), "travel")
    return path.read_bytes()


@pytest.fixture
def put(tmp_path):
    def put(data, name="T07.mcap.partial"):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return put


def chunks(data):
    """Return the chunks of a `.partial`, which has no magic at its end."""
    return [s for s in spans(data + bytes(8)) if s.opcode == CHUNK]


def salvaged_messages(data, path):
    """Return the log time of every message salvaged from `data`."""
    salvage = SoundRecords(data, path)
    found = [r.log_time for r in salvage if hasattr(r, "log_time")]
    return found, salvage


def test_a_file_cut_in_its_last_chunk_keeps_all_earlier_ones(tmp_path):
    """Three chunks of two cycles each; the last one is cut everywhere."""
    data = partial_bytes(tmp_path, make_cycles(6), block=2)
    last = chunks(data)[-1]
    whole, _ = salvaged_messages(data, tmp_path)
    before, _ = salvaged_messages(data[: last.start], tmp_path)
    assert 0 < len(before) < len(whole)
    for end in range(last.start, last.end):
        found, salvage = salvaged_messages(data[:end], tmp_path)
        assert found == before, end
        # cut right behind the chunk before, nothing of it was there to be lost
        gaps = [(gap.start, gap.end) for gap in salvage.gaps]
        assert gaps == ([(last.start, end)] if end > last.start else [])
    assert salvaged_messages(data[: last.end], tmp_path)[0] == whole


def test_a_truncated_file_gives_its_complete_chunks_or_is_refused(put, left, cycles):
    ends = [span.end for span in chunks(left)]
    rng = np.random.default_rng(3)
    cuts = rng.integers(0, len(left), 40).tolist()
    for cut in [*cuts, ends[0] - 1, ends[0], ends[-1]]:
        path = put(left[:cut])
        wanted = BLOCK * sum(end <= cut for end in ends)
        if not wanted:
            with pytest.raises(TrialFileError, match="nothing to save"):
                recover_file(path)
            continue
        recovery = recover_file(path)
        found = TrialReader(recovery.path).cycles().data
        assert found["position"].tobytes() == cycles["position"][:wanted].tobytes()
        assert recovery.verified.cycles == wanted
        recovery.path.unlink()


def test_every_topic_is_recovered_unchanged(put, sealed, left):
    theirs = messages_of(put(sealed, "T01.mcap"))
    saved = messages_of(recover_file(put(left)).path)
    assert saved.keys() == theirs.keys()
    for topic, messages in saved.items():
        assert messages == theirs[topic][: len(messages)]
    assert len(saved["/cycle"]) == 300


def test_descriptions_from_before_the_trial_are_recovered(put, left):
    reader = TrialReader(recover_file(put(left)).path)
    assert reader.attachments == ATTACHMENTS
    assert reader.metadata["trial"]["session"] == "S"
    assert {"clock", "provenance", "channels"} <= reader.metadata.keys()


def test_a_damaged_chunk_costs_only_itself(put, sealed, cycles):
    third = chunks(sealed)[2]
    path = put(flipped(sealed, (third.body + third.end) // 2), "T01.mcap")
    recovery = recover_file(path)
    found = TrialReader(recovery.path).cycles().data
    kept = np.delete(cycles["position"], slice(2 * BLOCK, 3 * BLOCK), 0)
    assert found["position"].tobytes() == kept.tobytes()
    assert recovery.bytes_dropped == third.end - third.start
    # 102 cycles of 2 ms passed before it: two of them were missed
    assert recovery.losses == (LostSpan(0.204, 0.1),)
    assert recover_file(path).losses == recovery.losses
    assert "chunk whose checksum" in recovery.reason or "decompress" in recovery.reason


def test_a_chunk_disguised_as_another_record_is_reported_lost(put, sealed):
    """Otherwise its gap would look like missed cycles."""
    third = chunks(sealed)[2].start
    for opcode in (MESSAGE_INDEX, 1, 0x86, 99):
        data = bytearray(sealed)
        data[third] = opcode
        recovery = recover_file(put(bytes(data), f"T{opcode}.mcap"))
        assert recovery.verified.cycles == 5 * BLOCK
        assert recovery.losses == (LostSpan(0.204, 0.1),)


def test_a_damaged_attachment_costs_only_itself(put, sealed):
    at = span_of(sealed, ATTACHMENT).end - 10
    recovery = recover_file(put(flipped(sealed, at), "T01.mcap"))
    reader = TrialReader(recovery.path)
    assert recovery.verified.cycles == 300
    assert reader.attachments == {"arm_model.toml": ATTACHMENTS["arm_model.toml"]}
    assert reader.metadata["recovered"]["attachments_dropped"] == "config.toml"


def test_a_lost_attachment_is_taken_from_a_neighbouring_file(put, sealed):
    put(sealed, "T02.mcap")
    at = span_of(sealed, ATTACHMENT).end - 10
    recovery = recover_file(put(flipped(sealed, at), "T01.mcap"))
    reader = TrialReader(recovery.path)
    assert (reader.attachments, recovery.missing_attachments) == (ATTACHMENTS, ())
    assert reader.metadata["recovered"]["attachments_dropped"] == ""


def test_a_different_attachment_of_the_same_name_is_not_taken(put, sealed, tmp_path):
    others = make_header(attachments={"config.toml": b"[rig]  # of another day"})
    seal(write_trial(tmp_path / "T00.mcap", make_cycles(100), others), "travel")
    at = span_of(sealed, ATTACHMENT).end - 10
    recovery = recover_file(put(flipped(sealed, at), "T01.mcap"))
    assert recovery.missing_attachments == ("config.toml",)
    assert "config.toml" not in TrialReader(recovery.path).attachments


def test_a_duplicated_description_is_copied_once(put, sealed):
    first = span_of(sealed, METADATA)
    again = sealed[first.start : first.end]
    recovery = recover_file(
        put(sealed[: first.end] + again + sealed[first.end :], "T01.mcap")
    )
    copied = recovery.path.read_bytes()
    found = [s for s in spans(copied) if s.opcode == METADATA]
    names = [copied[span.body + 4 : span.end] for span in found]
    assert sum(name.startswith(again[13:17]) for name in names) == 1


def test_a_lost_block_at_the_head_loses_no_data(put, sealed):
    """The identity of the trial is stored a second time."""
    end = span_of(sealed, ATTACHMENT).start
    recovery = recover_file(put(bytes(end) + sealed[end:], "T01.mcap"))
    whole = TrialReader(put(sealed, "T02.mcap"))
    reader = TrialReader(recovery.path)
    for name in ("trial", "clock", "provenance", "channels"):
        assert reader.metadata[name] == whole.metadata[name]
    assert (recovery.verified.cycles, recovery.losses) == (300, ())
    assert reader.attachments == ATTACHMENTS


@pytest.mark.parametrize("reason", ["", "has a broken record"])
def test_a_file_without_its_trial_identity_is_refused(put, sealed, reason):
    names = [sealed[s.body + 4 : s.body + 9] for s in spans(sealed)]
    first, second = [
        s for s, name in zip(spans(sealed), names, strict=True) if name == b"trial"
    ]
    data = sealed[: second.start] + sealed[second.end :]
    data = data[: first.start] + data[first.end :]
    if reason:
        data = flipped(flipped(sealed, first.body + 3), second.body + 3)
    with pytest.raises(TrialFileError, match=r"nothing to save: it [a-z].+") as refused:
        recover_file(put(data, "T01.mcap"))
    is_reported = "; what says which trial it is was there" in refused.value.message
    assert is_reported is bool(reason)


def test_a_lost_summary_loses_nothing_else(put, sealed):
    recovery = recover_file(put(sealed[:-50]))
    assert (recovery.verified.cycles, recovery.bytes_dropped) == (300, 0)
    assert TrialReader(recovery.path).metadata["result"]["stop_reason"] == "travel"


def test_a_truth_file_is_recovered_too(tmp_path):
    records = np.frombuffer(bytearray(TRUTH.template * 9), TRUTH.dtype)
    records["host_ns"] = START_NS + np.arange(9)
    path = tmp_path / "T07.truth.mcap"
    writer = TrialWriter(path, make_header(), TRUTH_TOPICS)
    writer.write_truth(records)
    writer.flush()
    writer.close_partial()
    recovery = recover_file(writer.partial)
    assert recovery.path.name == "T07.truth.recovered.mcap"
    assert len(TrialReader(recovery.path).truth().data) == 9


def test_a_truth_file_without_definitions_is_recognised_by_its_messages(tmp_path):
    records = np.frombuffer(bytearray(TRUTH.template * 9), TRUTH.dtype)
    records["host_ns"] = START_NS + np.arange(9)
    path = tmp_path / "T07.truth.mcap"
    writer = TrialWriter(path, make_header(), TRUTH_TOPICS)
    for part in (records[:4], records[4:]):
        writer.write_truth(part)
        writer.flush()
    writer.close_partial()
    data = writer.partial.read_bytes()
    first = chunks(data)[0]
    writer.partial.write_bytes(flipped(data, first.end - 9))
    recovery = recover_file(writer.partial)
    assert len(TrialReader(recovery.path).truth().data) == 5


@pytest.mark.parametrize(
    ("texts", "is_sound"),
    [
        ((b"key", b"value"), True),
        ((b"key", b"value", b"key"), False),  # a key without a value
        ((), False),
        ((b"key", b"value", b""), False),
    ],
)
def test_a_gap_does_not_end_at_an_incomplete_description(tmp_path, texts, is_sound):
    pairs = b"".join(struct.pack("<I", len(text)) + text for text in texts)
    body = struct.pack("<I", 4) + b"name" + struct.pack("<I", len(pairs)) + pairs
    data = MAGIC_BYTES + b"\xff" * 30 + record(METADATA, body)
    found = list(SoundRecords(data, tmp_path / "T01.mcap"))
    assert any(isinstance(r, Metadata) for r in found) is is_sound


def test_a_missing_chunk_is_reported_lost(put, sealed):
    third = chunks(sealed)[2]
    recovery = recover_file(
        put(sealed[: third.start] + sealed[third.end :], "T01.mcap")
    )
    assert recovery.verified.cycles == 5 * BLOCK
    assert recovery.losses == (LostSpan(0.204, 0.1),)


def test_a_duplicated_chunk_is_read_once(put, left):
    last = chunks(left)[-1]
    again = left[last.start : last.end]
    whole, _ = salvaged_messages(left, put(left))
    found, salvage = salvaged_messages(left + again, put(left))
    assert found == whole
    assert "a chunk out of order" in salvage.reason
    assert salvage.lost_bytes == len(again)


def test_a_zeroed_first_chunk_is_detected_from_the_summary(put, sealed):
    first = chunks(sealed)[0]
    zeroed = sealed[: first.body] + bytes(first.end - first.body) + sealed[first.end :]
    assert recover_file(put(zeroed, "T01.mcap")).losses == (LostSpan(0.0, 0.104),)


def test_a_copy_with_a_damaged_description_is_doubtful(put, sealed):
    at = span_of(sealed, METADATA).end - 3
    recovery = recover_file(put(flipped(sealed, at, 2), "T01.mcap"))
    assert recovery.is_doubtful
    assert (recovery.verified.cycles, recovery.losses) == (300, ())
    assert recover_file(recovery.source).is_doubtful
    third = chunks(sealed)[2]
    known = recover_file(put(flipped(sealed, third.body + 90), "T02.mcap"))
    assert not known.is_doubtful


def test_a_recovered_trial_is_readable_and_incomplete(put, left):
    recovery = recover_file(put(left))
    verified = verify_file(recovery.path)
    assert verified == recovery.verified
    assert verified.is_complete is TrialReader(recovery.path).is_complete is False
    assert verified.cycles == 300


def test_a_recovered_trial_names_its_source(put, left):
    cut = left[:-100]
    recovery = recover_file(put(cut))
    fields = TrialReader(recovery.path).metadata["recovered"]
    assert fields["source"] == "T07.mcap.partial"
    assert fields["source_sha256"] == hashlib.sha256(cut).hexdigest()
    assert fields["source_bytes"] == str(len(cut))
    assert int(fields["messages_kept"]) == recovery.messages > 300
    kept = len(cut) - recovery.bytes_dropped
    assert fields["reason"] == f"is cut off in the record at byte {kept}"


def test_missed_and_late_cycles_are_recounted(put, tmp_path):
    late = make_cycles(100, skipped=(1050, 1051))
    late["flags"][::10] |= np.uint32(Flag.DEADLINE_MISSED)
    path = put(partial_bytes(tmp_path, late))
    result = TrialReader(recover_file(path).path).metadata["result"]
    assert result == {
        "complete": "false",
        "stop_reason": "recovered",
        "cycles_expected": "102",
        "cycles_written": "100",
        "cycles_missed": "2",
        "late_cycles": "10",
    }


def test_a_message_as_long_as_a_cycle_is_not_counted_as_a_cycle(put, left):
    channels = TrialReader(recover_file(put(left)).path).summary.channels
    other = next(n for n, known in channels.items() if known.topic != "/cycle")
    body = struct.pack("<HIQQ", other, 0, START_NS, START_NS) + CYCLE.template
    message = struct.pack("<BQ", MESSAGE, len(body)) + body
    recovery = recover_file(put(left + message, "T08.mcap.partial"))
    assert recovery.messages == recover_file(put(left)).messages + 1
    assert TrialReader(recovery.path).metadata["result"]["cycles_written"] == "300"


def test_losses_are_reported_in_seconds(put, left):
    """The head of the torn chunk still states its last time."""
    last = chunks(left)[-1]
    recovery = recover_file(put(left[: last.end - 5]))
    # 50 cycles of 2 ms in the lost chunk, none of them missed
    assert recovery.seconds_dropped == pytest.approx(0.1, abs=1e-6)
    # also if only its head is left: first and last time of 8 bytes each
    recovery = recover_file(put(left[: last.body + 16], "T08.mcap.partial"))
    assert recovery.seconds_dropped == pytest.approx(0.1, abs=1e-6)


def test_an_implausible_time_in_a_torn_chunk_is_rejected(put, left):
    last = chunks(left)[-1]
    data = bytearray(left[: last.end - 5])
    struct.pack_into("<Q", data, last.body + 8, 2**63)
    assert recover_file(put(bytes(data))).seconds_dropped == 0.0


@pytest.mark.parametrize(("minutes", "is_believed"), [(59, True), (61, False)])
def test_times_in_a_torn_chunk_are_bounded(put, left, minutes, is_believed):
    last = chunks(left)[-1]
    before_ns = struct.unpack_from("<Q", left, chunks(left)[-2].body + 8)[0]
    data = bytearray(left[: last.end - 5])
    struct.pack_into("<Q", data, last.body + 8, before_ns + minutes * 60 * NS_PER_S)
    dropped = recover_file(put(bytes(data))).seconds_dropped
    assert dropped == pytest.approx(minutes * 60.0 * is_believed, abs=0.01)


def test_a_bad_cadence_does_not_prevent_recovery(tmp_path):
    slow = make_cycles(100)
    slow["host_ns"] = START_NS + np.arange(100) * 3_000_000
    writer = write_trial(tmp_path / "T01.mcap", slow)
    with pytest.raises(TrialFileError, match="median period"):
        seal(writer, "travel")
    recovery = recover_file(writer.partial)
    assert (recovery.verified.cycles, recovery.bytes_dropped) == (100, 0)


def test_the_source_is_kept_and_the_copy_is_read_only(put, left):
    path = put(left)
    recovery = recover_file(path)
    assert path.read_bytes() == left
    assert recovery.path == path.parent / "T07.recovered.mcap"
    assert stat.S_IMODE(recovery.path.stat().st_mode) == 0o444
    assert sorted(p.name for p in path.parent.iterdir()) == [
        "T07.mcap.partial",
        "T07.recovered.mcap",
    ]


def test_a_complete_file_is_reported_complete(put, sealed):
    path = put(sealed)
    recovery = recover_file(path)
    assert (recovery.path, recovery.is_new) == (path, False)
    assert recovery.verified.is_complete
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def file_state(path):
    """Return the content of a file with its inode, size, mode and times of change."""
    now = path.stat()
    changed = now.st_mtime_ns, now.st_ctime_ns
    return path.read_bytes(), now.st_ino, now.st_size, now.st_mode, changed


def test_a_second_recovery_reuses_the_first(put, left):
    path = put(left)
    first = recover_file(path)
    written = file_state(first.path)
    second = recover_file(path)
    assert (first.is_new, second.is_new) == (True, False)
    assert (second.path, second.messages) == (first.path, first.messages)
    assert file_state(first.path) == written


def test_another_recovered_file_is_never_overwritten(put, left):
    path = put(left)
    other = recover_file(path).path.read_bytes()
    put(left[:-100])
    with pytest.raises(TrialFileError, match="exists already"):
        recover_file(path)
    assert recovered_path(path).read_bytes() == other


def test_a_full_disk_leaves_no_half_file(put, left, monkeypatch):
    path = put(left)

    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TrialFileError, match="No space left") as caught:
        recover_file(path)
    assert caught.value.path == recovered_path(path)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize(
    "data", [b"", b"\x89MCAP0\r\n", b"not a trial at all", bytes(99)]
)
def test_a_file_without_records_is_refused(put, data):
    path = put(data)
    with pytest.raises(TrialFileError, match="nothing to save"):
        recover_file(path)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_file_name_that_is_not_text_is_accepted(put, left):
    recovery = recover_file(put(left, os.fsdecode(b"T\xff07.mcap.partial")))
    assert recovery.verified.cycles == 300


@pytest.mark.parametrize(
    ("source", "target"),
    [
        ("T07.mcap.partial", "T07.recovered.mcap"),
        ("T07.truth.mcap.partial", "T07.truth.recovered.mcap"),
        ("T07.mcap", "T07.recovered.mcap"),
        ("odd", "odd.recovered.mcap"),
    ],
)
def test_the_recovered_name_derives_from_the_source(tmp_path, source, target):
    assert recovered_path(tmp_path / source) == tmp_path / target


def test_the_length_of_a_recording_is_read_from_its_chunks(left):
    # 303 cycles of 2 ms passed between the first and the last
    assert recorded_seconds(left) == pytest.approx(302 * 0.002)
    half = recorded_seconds(left[: chunks(left)[3].start + 3])
    assert half == pytest.approx(151 * 0.002)
    assert recorded_seconds(b"") == 0.0


def record(opcode, body):
    return struct.pack("<BQ", opcode, len(body)) + body


def channel_record(number, schema):
    """Return a channel of a schema that may be missing."""
    fields = struct.pack("<HH", number, schema)
    return record(4, fields + struct.pack("<I", 2) + b"/x" + bytes(8))


def message_record(channel):
    return record(5, struct.pack("<HIQQ", channel, 0, 0, 0) + b"content")


MAGIC_BYTES = b"\x89MCAP0\r\n"


@pytest.mark.parametrize(
    ("records", "reason"),
    [
        (channel_record(7, 9), "a channel without a schema"),
        (message_record(7), "messages without a channel"),
    ],
)
def test_a_record_with_a_dangling_reference_is_omitted(tmp_path, records, reason):
    sound = channel_record(1, 0) + message_record(1)
    data = MAGIC_BYTES + sound + records + message_record(1)
    salvage = SoundRecords(data, tmp_path / "T01.mcap")
    kinds = [type(record).__name__ for record in salvage]
    assert kinds == ["Channel", "Message", "Gap", "Message"]
    assert reason in salvage.reason
    assert salvage.lost_bytes == len(records)


def chunk_record(content, crc):
    """Return a chunk that is not compressed; `crc` 0 = without a checksum."""
    head = struct.pack("<QQQIIQ", 0, 0, len(content), crc, 0, len(content))
    return record(CHUNK, head + content)


def kinds_of(data, path):
    return [type(record).__name__ for record in SoundRecords(data, path)]


def test_after_damage_a_chunk_without_a_checksum_is_not_trusted(tmp_path):
    content = channel_record(1, 0) + message_record(1)
    path, damage = tmp_path / "T01.mcap", b"\xff" * 30
    proved = chunk_record(content, zlib.crc32(content))
    bare, whole = chunk_record(content, 0), ["Channel", "Message"]
    assert kinds_of(MAGIC_BYTES + damage + proved, path) == ["Gap", *whole]
    assert kinds_of(MAGIC_BYTES + damage + bare, path) == ["Gap"]
    assert kinds_of(MAGIC_BYTES + bare, path) == whole


@pytest.mark.parametrize("size", [1, 2, 9])
def test_surplus_bytes_before_a_chunk_cost_no_data(tmp_path, size):
    content = channel_record(1, 0) + message_record(1)
    chunk = chunk_record(content, zlib.crc32(content))
    data = MAGIC_BYTES + b"\xff" * size + chunk
    salvage = SoundRecords(data, tmp_path / "T01.mcap")
    kinds = [type(record).__name__ for record in salvage]
    assert kinds == ["Gap", "Channel", "Message"]
    (gap,) = salvage.gaps
    assert (gap.start, gap.end) == (len(MAGIC_BYTES), len(MAGIC_BYTES) + size)


@pytest.mark.parametrize("is_torn", [False, True])
def test_channels_are_read_from_beyond_a_premature_data_end(tmp_path, is_torn):
    """Also if the data end is all that is left of the file's head."""
    content, end = message_record(77), record(15, bytes(4))
    chunk = chunk_record(content, zlib.crc32(content))
    data = end + b"\xff" * 30 + chunk if is_torn else MAGIC_BYTES + chunk + end
    kinds = kinds_of(data + channel_record(77, 0), tmp_path / "T01.mcap")
    assert [kind for kind in kinds if kind != "Gap"][:2] == ["Channel", "Message"]


def test_a_record_of_an_unknown_kind_does_not_end_a_gap(put, left):
    third, fourth = chunks(left)[2:4]
    unknown = record(16, bytes(20))
    data = flipped(left, third.end - 9)
    data = data[: third.end] + unknown + data[third.end :]
    salvage = salvaged_messages(data, put(data))[1]
    gaps = [(gap.start, gap.end) for gap in salvage.gaps]
    assert gaps == [(third.start, fourth.start + len(unknown))]


def test_a_definition_quoted_in_an_attachment_is_ignored(tmp_path):
    quoted = channel_record(77, 0) * 2
    fields = struct.pack("<QQI", 0, 0, 1) + b"a" + struct.pack("<IQ", 0, len(quoted))
    body = fields + quoted
    attachment = record(ATTACHMENT, body + struct.pack("<I", zlib.crc32(body)))
    content = message_record(77)
    data = MAGIC_BYTES + attachment + chunk_record(content, zlib.crc32(content))
    salvage = SoundRecords(data, tmp_path / "T01.mcap")
    assert [type(item).__name__ for item in salvage] == ["Attachment", "Gap"]
    assert "messages without a channel" in salvage.reason


def test_a_channel_without_a_schema_has_none_in_the_copy(put, left):
    data = left + channel_record(99, 0) + message_record(99)
    recovery = recover_file(put(data))
    with recovery.path.open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    schemas = {channel.topic: channel.schema_id for channel in channels}
    assert schemas["/x"] == 0
    assert schemas["/cycle"] > 0


def test_a_chunk_damaged_in_the_middle_yields_no_messages(tmp_path):
    content = chunk_content(compression="") + message_record(99)
    data = with_chunk(content, len(content), compression="")
    found, salvage = salvaged_messages(data, tmp_path / "T01.mcap")
    assert "messages without a channel" in salvage.reason
    assert found == []
    whole = content[: -len(message_record(99))]
    data = with_chunk(whole, len(whole), compression="")
    assert len(salvaged_messages(data, tmp_path / "T01.mcap")[0]) == 1


def test_a_file_without_the_magic_is_not_an_mcap_file(tmp_path):
    data = b"x" * len(MAGIC_BYTES) + channel_record(1, 0) + message_record(1)
    salvage = SoundRecords(data, tmp_path / "T01.mcap")
    assert list(salvage) == []
    assert "no MCAP file" in salvage.reason


def test_a_complete_file_has_no_loss(put, sealed):
    recovery = recover_file(put(sealed, "T09.mcap"))
    assert (recovery.seconds_dropped, recovery.bytes_dropped) == (0.0, 0)


def test_a_chunk_that_ends_within_a_record_is_damaged(tmp_path):
    content = chunk_content(compression="") + b"\x05\x10"
    data = with_chunk(content, len(content), compression="")
    found, salvage = salvaged_messages(data, tmp_path / "T01.mcap")
    assert found == []
    assert "ends in a record" in salvage.reason


@pytest.mark.parametrize(
    ("index", "is_sound"),
    [
        (struct.pack("<HI", 1, 0), True),  # of a channel without a message
        (struct.pack("<HI", 1, 16) + bytes(16), True),
        (struct.pack("<HI", 1, 8) + bytes(8), False),
        (struct.pack("<HI", 1, 16) + bytes(8), False),
        (b"\x01\x00", False),
    ],
)
def test_a_message_index_is_complete_or_reported_damaged(tmp_path, index, is_sound):
    before = channel_record(1, 0) + message_record(1)
    data = MAGIC_BYTES + before + record(MESSAGE_INDEX, index) + message_record(1)
    salvage = SoundRecords(data, tmp_path / "T01.mcap")
    assert sum(isinstance(record, Message) for record in salvage) == 2
    assert len(salvage.gaps) == (0 if is_sound else 1)
    assert ("damaged message index" in salvage.reason) is not is_sound


@pytest.mark.parametrize("topics", [TRIAL_TOPICS, FLIGHT_TOPICS, TRUTH_TOPICS])
def test_topics_are_recognised_by_their_message_sizes(topics):
    own = {"/cycle": CYCLE.size, "/truth": TRUTH.size}
    sizes = {i: own.get(topic, 77) for i, topic in enumerate(topics, 1)}
    assert topics_by_sizes(sizes) == topics


def test_messages_of_another_version_are_not_recognised():
    number = list(TRIAL_TOPICS).index("/cycle") + 1
    assert topics_by_sizes({number: CYCLE.size - 4}) == {}
    assert topics_by_sizes({number: CYCLE.size, 40: 8}) == {}
