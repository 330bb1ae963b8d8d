from typing import Any

import numpy as np
import pytest

from acquisition.sample import CHANNELS, Sample
from acquisition.schema import CYCLE, TRUTH, fixed_layout, schema_text
from tests.acquisition.ros import decode, encode

TYPES = [
    "traction_msgs/msg/Cycle",
    "traction_msgs/msg/Truth",
    "traction_msgs/msg/CanBatch",
    "traction_msgs/msg/WrenchBatch",
    "rcl_interfaces/msg/Log",
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/WrenchStamped",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TwistStamped",
    "std_msgs/msg/String",
]


def filled(layout, seed) -> Any:
    """Return one record with every number set to something of its own."""
    rng = np.random.default_rng(seed)
    record = np.frombuffer(bytearray(layout.template), layout.dtype)
    for name in numbers_of(layout):
        kind: Any = record[name].dtype
        shape = record[name].shape
        if kind.kind == "f":
            record[name] = rng.normal(size=shape)
        else:
            info = np.iinfo(kind)
            record[name] = rng.integers(info.min, info.max, shape, kind, endpoint=True)
    return record


def numbers_of(layout):
    names = layout.dtype.names
    return [n for n in names[5:] if not n.startswith("padding")]


def test_a_cycle_has_its_documented_size():
    assert CYCLE.size == 548
    assert b"wam_base\0" in CYCLE.template


@pytest.mark.parametrize("layout", [CYCLE, TRUTH], ids=["cycle", "truth"])
@pytest.mark.parametrize("seed", range(3))
def test_fixed_layouts_decode_bit_identically(layout, seed):
    record = filled(layout, seed)
    message = decode(layout.type_name, record.tobytes())
    for name in numbers_of(layout):
        ours, theirs = record[name][0], np.asarray(getattr(message, name))
        assert ours.tobytes() == theirs.astype(ours.dtype).tobytes(), name


@pytest.mark.parametrize("layout", [CYCLE, TRUTH], ids=["cycle", "truth"])
def test_fixed_layouts_agree_byte_for_byte_with_an_independent_writer(layout):
    payload = filled(layout, 7).tobytes()
    assert encode(layout.type_name, decode(layout.type_name, payload)) == payload


def test_the_header_is_part_of_the_layout():
    record = np.frombuffer(bytearray(CYCLE.template), CYCLE.dtype)
    record["sec"], record["nanosec"] = 1_700_000_000, 999_999_999
    header = decode(CYCLE.type_name, record.tobytes()).header
    assert (header.stamp.sec, header.stamp.nanosec) == (1_700_000_000, 999_999_999)
    assert header.frame_id == "wam_base"


@pytest.mark.parametrize("frame_id", ["a", "ab", "abc", "abcd", "ft_sensor", ""])
def test_any_frame_name_keeps_the_numbers_aligned(frame_id):
    layout = fixed_layout("traction_msgs/msg/Cycle", frame_id)
    record = filled(layout, 1)
    message = decode(layout.type_name, record.tobytes())
    assert message.header.frame_id == frame_id
    assert message.traction.tolist() == record["traction"][0].tolist()
    assert message.host_ns == record["host_ns"][0]


@pytest.mark.parametrize("layout", [CYCLE, TRUTH], ids=["cycle", "truth"])
def test_every_byte_of_a_record_is_defined(layout):
    sizes = [layout.dtype[name].itemsize for name in layout.dtype.names]
    assert sum(sizes) == layout.size


@pytest.mark.parametrize("type_name", TYPES)
def test_a_definition_brings_every_type_it_uses(type_name):
    text = schema_text(type_name)
    defined = {line[5:] for line in text.splitlines() if line.startswith("MSG: ")}
    used = {
        line.split()[0]
        for line in text.splitlines()
        if line and "/" in line.split()[0] and not line.startswith("=")
    }
    assert used == defined


def test_an_unknown_message_has_no_definition():
    with pytest.raises(KeyError):
        schema_text("traction_msgs/msg/Nonsense")


def test_every_number_of_a_cycle_has_a_channel_with_unit_and_sign():
    described = {channel.field.removeprefix("cycle.") for channel in CHANNELS}
    assert described == set(numbers_of(CYCLE)) - {"cycle", "flags"}


def test_a_sample_writes_into_its_payload():
    sample = Sample()
    sample.host_ns[0] = 123
    sample.position[:] = np.arange(7)
    message = decode(CYCLE.type_name, bytes(sample.payload()))
    assert message.host_ns == 123
    assert message.position.tolist() == list(range(7))


def test_a_sample_begins_without_forces():
    message = decode(CYCLE.type_name, bytes(Sample().payload()))
    assert np.isnan(message.wrench).all()
    assert np.isnan(message.wrench_raw).all()
    assert np.isnan(message.traction).all()
    assert not np.isnan(message.position).any()
