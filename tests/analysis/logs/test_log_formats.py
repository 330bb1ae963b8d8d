"""Logs of another library are read whole, damaged and packed ones within bounds."""

import os
import sqlite3
import struct
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.writer import Writer

from acquisition.errors import SettingsError
from acquisition.trial_file.unpacking import DamageError, Unpacker
from analysis.logs import bag_log, channels, mcap_log
from analysis.logs.channels import read_channels
from analysis.logs.log_file import LARGEST_PART, LARGEST_RATIO, copy_bounded
from analysis.logs.opening import open_log
from analysis.logs.record import RECORD, read_record
from analysis.logs.robot import read_urdf
from tests.analysis.logs.gantry import StrokeLog, write_bag, write_bag2

SHORT = StrokeLog(joint_rate=100.0, wrench_rate=100.0)
WRENCH = "/ft/wrench"
FORMATS = {
    "bag": (write_bag, ()),
    "bag-bz2": (write_bag, ("BZ2",)),
    "bag-lz4": (write_bag, ("LZ4",)),
    "mcap": (write_bag2, ("MCAP",)),
    "mcap-message": (write_bag2, ("MCAP", "STORAGE")),
    "db3": (write_bag2, ("SQLITE3",)),
    "db3-message": (write_bag2, ("SQLITE3", "MESSAGE")),
    "db3-file": (write_bag2, ("SQLITE3", "FILE")),
}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Return the same log in every format."""
    folder = tmp_path_factory.mktemp("logs")
    return {
        name: write(folder / f"{name}.bag", SHORT, *more)
        for name, (write, more) in FORMATS.items()
    }


def read(path):
    with open_log(path) as log:
        found = [
            (m.topic, m.received_ns, len(m.data)) for m in log.messages(log.topics)
        ]
        return {t.name: t.type_name for t in log.topics.values()}, found, log.losses


@pytest.mark.parametrize("name", FORMATS)
def test_every_message_of_every_format_is_read(logs, name):
    topics, found, losses = read(logs[name])
    assert topics == {
        "/joint_states": "sensor_msgs/JointState",
        WRENCH: "geometry_msgs/WrenchStamped",
    }
    assert len(found) == 2400
    assert losses == []
    _, same, _ = read(logs["bag"])
    assert [row[:2] for row in found] == [row[:2] for row in same]


@pytest.mark.parametrize("name", ["bag", "bag-lz4", "mcap"])
@pytest.mark.parametrize("share", [0.2, 0.4, 0.6])
def test_a_truncated_log_is_read_to_its_end(logs, tmp_path, name, share):
    path = logs[name]
    file = next(path.glob("*.mcap")) if path.is_dir() else path
    cut = tmp_path / file.name
    data = file.read_bytes()
    cut.write_bytes(data[: int(share * len(data))])
    _, found, losses = read(cut)
    assert len(losses) == 1
    assert "nothing is read after byte" in losses[0]
    assert len(found) < 2400


def test_a_topic_of_another_encoding_is_reported_and_not_read(tmp_path):
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.Log", "jsonschema", b"{}")
        channel = writer.register_channel("/log", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with open_log(path) as log:
        assert log.topics == {}
        assert log.unread == {"/log": "foxglove.Log, json"}
        assert list(log.messages(["/log"])) == []


@pytest.mark.parametrize("spoil", [False, True])
def test_damaged_metadata_do_not_end_a_log(tmp_path, spoil):
    """No message depends on them."""
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, enable_crcs=False)
        writer.start()
        writer.add_metadata("trial", {"simulated": "true"})
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string s")
        channel = writer.register_channel("/said", "cdr", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    if spoil:
        path.write_bytes(path.read_bytes().replace(b"simulated", b"\xffimulated"))
    with open_log(path) as log:
        assert log.is_simulated is not spoil
        assert [m.topic for m in log.messages(log.topics)] == ["/said"]
        assert log.losses == []


def test_a_file_that_is_not_a_log_is_refused(tmp_path):
    for name, data, why in (
        ("a.csv", b"t,v_t\n1,2\n", "not a known log format"),
        ("a.parquet", b"PAR1" + bytes(20), "not a known log format"),
        ("a.bag", b"#ROSBAG V1.2\n" + bytes(20), "a bag of format 1"),
        ("a.db3", b"SQLite format 3\0" + bytes(200), "cannot be read as a database"),
        ("a.mcap.zstd", zstandard.compress(bytes(9_000_000)), "unpacks to over"),
    ):
        path = tmp_path / name
        path.write_bytes(data)
        with pytest.raises(SettingsError, match=why), open_log(path):
            pass
    with pytest.raises(SettingsError, match="no logs in this folder"):
        read(tmp_path / "..")


@pytest.mark.parametrize(
    ("name", "module", "words"),
    [
        ("bag", bag_log, "over 1 topics"),
        ("mcap", mcap_log, "over 1 types"),
    ],
)
def test_a_log_of_too_many_topics_is_refused(logs, monkeypatch, name, module, words):
    monkeypatch.setattr(module, "MOST_TOPICS", 1)
    with pytest.raises(SettingsError, match=words):
        read(logs[name])


@pytest.mark.parametrize(
    ("header", "why"),
    [
        (struct.pack("<I", 99) + b"op=\2", "a field exceeds its header"),
        (struct.pack("<I", 2) + b"op", "a header has an invalid field"),
    ],
)
def test_a_damaged_header_of_a_bag_ends_it(tmp_path, header, why):
    assert losses_of_bag(tmp_path, struct.pack("<I", len(header)) + header) == why


def test_a_record_beyond_the_limit_ends_a_bag(tmp_path):
    size = LARGEST_PART + 1
    assert (
        losses_of_bag(tmp_path, struct.pack("<I", size)) == f"a record of {size} bytes"
    )


def test_a_record_that_exceeds_its_chunk_ends_a_bag(tmp_path):
    inner = struct.pack("<I", 99)
    fields = [b"op=\5", b"compression=none", b"size=" + struct.pack("<I", len(inner))]
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    chunk = struct.pack("<I", len(header)) + header
    chunk += struct.pack("<I", len(inner)) + inner
    assert losses_of_bag(tmp_path, chunk) == "a record exceeds its chunk"


def losses_of_bag(tmp_path, records):
    """Read a bag that ends at its first record; return why."""
    path = tmp_path / "a.bag"
    path.write_bytes(bag_log.MAGIC + records)
    _, found, (loss,) = read(path)
    assert found == []
    return loss.removeprefix(f"nothing is read after byte {len(bag_log.MAGIC)}: ")


def test_a_topic_of_too_many_messages_is_refused(logs, monkeypatch):
    monkeypatch.setattr(channels, "MOST_MESSAGES", 5)
    with open_log(logs["bag"]) as log:
        topics = log.topics
        joints, wrench = topics["/joint_states"], topics[WRENCH]
        with pytest.raises(SettingsError, match="over 5 messages of /"):
            read_channels(log, joints, ["slide_x"], wrench, None)


@pytest.mark.parametrize("beside", ["", "-wal", "-journal"])
def test_a_pipe_is_refused_at_once(logs, tmp_path, beside):
    (file,) = logs["db3"].glob("*.db3")
    path = tmp_path / file.name
    if beside:
        path.write_bytes(file.read_bytes())
    os.mkfifo(f"{path}{beside}")
    with pytest.raises(SettingsError, match="regular file") as error:
        read(path)
    assert f"{path}{beside}: " in str(error.value)


@pytest.mark.parametrize(
    ("name", "read_file"),
    [("leg.urdf", read_urdf), (RECORD, lambda path: read_record(path.parent))],
    ids=["urdf", "record"],
)
def test_a_pipe_beside_a_log_is_refused_at_once(tmp_path, name, read_file):
    os.mkfifo(tmp_path / name)
    with pytest.raises(SettingsError, match="is not a regular file") as error:
        read_file(tmp_path / name)
    assert str(tmp_path / name) in str(error.value)


def test_a_full_disk_ends_the_copy_of_a_log(tmp_path):
    path = tmp_path / "log.db3"
    path.write_bytes(bytes(10))
    with pytest.raises(SettingsError, match=r"cannot be copied .*No space left"):
        copy_bounded([path], [Path("/dev/full")])


@pytest.mark.parametrize(
    ("damage", "why"),
    [
        (lambda data: data[:-1000], "cannot be read as a database"),
        (
            lambda data: data[:6] + bytes(20) + data[26:],
            "a packed part that is damaged",
        ),
    ],
    ids=["cut", "overwritten"],
)
def test_a_damaged_packed_log_is_refused_by_its_own_name(logs, tmp_path, damage, why):
    (file,) = logs["db3-file"].glob("*.zstd")
    path = tmp_path / file.name
    path.write_bytes(damage(file.read_bytes()))
    with pytest.raises(SettingsError) as error:
        read(path)
    assert f"{path}: {why}" in str(error.value)


def test_a_message_that_is_text_ends_a_database(logs, tmp_path):
    (file,) = logs["db3"].glob("*.db3")
    path = tmp_path / file.name
    path.write_bytes(file.read_bytes())
    with sqlite3.connect(path) as database:
        database.execute("UPDATE messages SET data = 'words' WHERE id = 10")
    database.close()
    _, found, losses = read(path)
    assert len(found) == 9
    assert losses == ["nothing is read after a message: a message is not bytes"]


def test_a_message_of_another_layout_is_refused_with_its_number(tmp_path):
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for kind, topic in (
            ("sensor_msgs/msg/JointState", "/joint_states"),
            ("geometry_msgs/msg/WrenchStamped", WRENCH),
        ):
            schema = writer.register_schema(kind, "ros2msg", b"")
            channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, 1, b"\0\1\0\0" + bytes(8), 1)
        writer.finish()
    with open_log(path) as log:
        topics = log.topics
        with pytest.raises(SettingsError, match="message 1 of /joint_states does not"):
            read_channels(log, topics["/joint_states"], ["j"], topics[WRENCH], None)


def test_a_view_instead_of_a_table_is_not_read(tmp_path):
    path = tmp_path / "a.db3"
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE topics(id, name, type, serialization_format)")
    database.execute(
        "CREATE VIEW messages AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x+1 "
        "FROM c) SELECT 1 AS topic_id, x AS timestamp, x'00' AS data FROM c"
    )
    database.commit()
    database.close()
    with pytest.raises(SettingsError, match="not a rosbag2 log"):
        read(path)


@pytest.mark.parametrize(
    "compression", ["zstd", "lz4", pytest.param("bz2", marks=pytest.mark.slow)]
)
def test_a_bomb_is_refused_and_not_unpacked(compression):
    import bz2

    import lz4.frame

    pack = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "bz2": bz2.compress}
    bomb = pack[compression](bytes(80 * 2**20))
    unpacker = Unpacker(LARGEST_PART, LARGEST_RATIO)
    for size in (None, 80 * 2**20):
        with pytest.raises(DamageError):
            unpacker.unpack(bomb, compression, size)
    fine = np.random.default_rng(1).bytes(100_000)
    assert unpacker.unpack(pack[compression](fine), compression, len(fine)) == fine
