import pytest
from hypothesis import given
from hypothesis import strategies as st

from wam.bus import frames
from wam.bus.frames import FrameError, Group

GOLDEN_GETS = [(0x05, "05"), (68, "44"), (86, "56"), (90, "5a"), (66, "42")]
GOLDEN_SETS = [
    (5, 2, "85 00 02 00 00 00"),
    (5, 0, "85 00 00 00 00 00"),
    (8, 0, "88 00 00 00 00 00"),
    (42, 500, "aa 00 f4 01 00 00"),
    (42, 1, "aa 00 01 00 00 00"),
    (48, -36833, "b0 00 1f 70 ff ff"),
    (48, 36832, "b0 00 e0 8f 00 00"),
    (48, -36728, "b0 00 88 70 ff ff"),
    (32, 45, "a0 00 2d 00 00 00"),
    (31, 45, "9f 00 2d 00 00 00"),
    (55, 5, "b7 00 05 00 00 00"),
    (46, 6144, "ae 00 00 18 00 00"),
    (45, 5529, "ad 00 99 15 00 00"),
    (48, 8100, "b0 00 a4 1f 00 00"),
    (47, 7290, "af 00 7a 1c 00 00"),
    (58, -123, "ba 00 85 ff ff ff"),
    (30, -1, "9e 00 ff ff ff ff"),
    (30, 98, "9e 00 62 00 00 00"),
    (17, 1, "91 00 01 00 00 00"),
    (54, 0, "b6 00 00 00 00 00"),
]
GOLDEN_REPLIES = [
    (5, 0, False, "85 00 00 00"),
    (5, 2, False, "85 00 02 00"),
    (0, 200, False, "80 00 c8 00"),
    (1, 0x100, False, "81 00 00 01"),
    (68, 4096, True, "c4 00 00 10 00 00"),
    (86, 17474, False, "d6 00 42 44"),
    (86, 2700, False, "d6 00 8c 0a"),
    (90, 6, False, "da 00 06 00"),
    (66, 1234, True, "c2 00 d2 04 00 00"),
    (9, 43, False, "89 00 2b 00"),
    (9, -5, False, "89 00 fb ff"),
    (42, 2048, False, "aa 00 00 08"),
    (43, 0x0D3F1249, True, "ab 00 49 12 3f 0d"),
    (43, 0x00794249, True, "ab 00 49 42 79 00"),
]
GOLDEN_POSITIONS = [
    (0, "00 00 00"),
    (-1, "3f ff ff"),
    (-2, "3f ff fe"),
    (36832, "00 8f e0"),
    (-36833, "3f 70 1f"),
    (-36728, "3f 70 88"),
    (2097151, "1f ff ff"),
    (-2097152, "20 00 00"),
    (163840, "02 80 00"),
]
GOLDEN_TORQUES = [
    ((0, 0, 0, 0), "aa 00 00 00 00 00 00 00"),
    ((1, -1, 2, -2), "aa 00 07 ff f0 00 bf fe"),
    ((8191, -8191, 9000, -9000), "aa 7f fe 00 17 ff e0 01"),
    ((-65, -878, 556, -750), "aa fe ff c9 20 8b 3d 12"),
    ((167, 33, -59), "aa 02 9c 02 1f f1 40 00"),
]
GOLDEN_SENSOR_TORQUES = [
    ((0.1, -0.25, 0.015), None, "9a 01 00 fc 3d 00"),
    ((0.1, -0.25, 0.015), 0x84, "9a 01 00 fc 3d 00 84"),
    ((0.0, 0.0, 0.0), 0xC4, "00 00 00 00 00 00 c4"),
]
int32 = st.integers(-(2**31), 2**31 - 1)
int14 = st.integers(-8191, 8191)


@pytest.mark.parametrize(
    ("sender", "to", "is_group", "expected"),
    [
        (0, 1, False, 0x001),
        (0, 10, False, 0x00A),
        (0, Group.ARM, True, 0x404),
        (1, Group.PROPERTY, True, 0x426),
        (7, Group.PROPERTY, True, 0x4E6),
        (10, Group.PROPERTY, True, 0x546),
        (7, Group.POSITION, True, 0x4E3),
        (4, Group.JOINT_ENCODER, True, 0x487),
        (8, Group.FORCE, True, 0x50A),
        (8, Group.TORQUE, True, 0x50B),
        (10, Group.BUS, True, 0x540),
    ],
)
def test_identifier_is_group_sender_receiver(sender, to, is_group, expected):
    assert frames.compose_id(sender, to, is_group=is_group) == expected
    assert frames.split_id(expected) == frames.Address(sender, to, is_group)


def test_reply_identifiers_belong_to_their_node():
    assert [frames.property_reply_id(n) for n in (1, 8)] == [0x426, 0x506]
    assert [frames.position_reply_id(n) for n in (1, 7)] == [0x423, 0x4E3]


@pytest.mark.parametrize("node", [-1, 32])
def test_a_node_beyond_five_bits_has_no_identifier(node):
    with pytest.raises(ValueError, match="0 to 31"):
        frames.compose_id(node, 0, is_group=False)


def test_an_extended_identifier_is_not_split():
    with pytest.raises(ValueError, match="11-bit"):
        frames.split_id(0x800)


@pytest.mark.parametrize(("number", "data"), GOLDEN_GETS)
def test_a_get_contains_only_the_property_number(number, data):
    assert frames.encode_get(number).hex(" ") == data


@pytest.mark.parametrize(("number", "value", "data"), GOLDEN_SETS)
def test_set_has_six_bytes_little_endian(number, value, data):
    assert frames.encode_set(number, value).hex(" ") == data


@pytest.mark.parametrize(("number", "value", "is_wide", "data"), GOLDEN_REPLIES)
def test_reply_is_read_and_written_at_its_width(number, value, is_wide, data):
    assert frames.encode_reply(number, value, is_wide=is_wide).hex(" ") == data
    assert frames.decode_reply(bytes.fromhex(data)) == frames.Property(number, value)


@pytest.mark.parametrize(
    "data",
    [
        "",
        "85",
        "85 00 02",
        "85 00 02 00 00",
        "85 00 02 00 00 00 00",
        "05 00 02 00",
        "85 01 02 00",
    ],
)
def test_a_reply_that_contradicts_the_layout_is_refused(data):
    with pytest.raises(FrameError):
        frames.decode_reply(bytes.fromhex(data))


@pytest.mark.parametrize("data", ["b0 00 54 14", "b0 00 54 14 00 00"])
def test_sets_of_four_and_six_bytes_mean_the_same(data):
    request = frames.decode_request(bytes.fromhex(data))
    assert request == frames.Property(48, 5204)


def test_a_lone_byte_with_its_top_bit_set_is_not_a_request():
    with pytest.raises(FrameError):
        frames.decode_request(b"\x85")


@given(st.integers(0, 127), int32)
def test_a_set_round_trips(number, value):
    request = frames.decode_request(frames.encode_set(number, value))
    assert request == frames.Property(number, value)


@given(st.integers(0, 127))
def test_a_get_round_trips(number):
    request = frames.decode_request(frames.encode_get(number))
    assert request == frames.Property(number, None)


@pytest.mark.parametrize(("counts", "data"), GOLDEN_POSITIONS)
def test_position_is_22_bits_big_endian(counts, data):
    assert frames.encode_position(counts).hex(" ") == data
    assert frames.decode_position(bytes.fromhex(data)) == counts


@pytest.mark.parametrize(
    ("data", "counts"),
    [("ff 90 00", -28672), ("40 00 00", 0), ("bf 90 00", -28672), ("c0 00 05", 5)],
)
def test_bits_above_the_22_of_a_position_have_no_meaning(data, counts):
    assert frames.decode_position(bytes.fromhex(data)) == counts


def test_position_with_joint_encoder_gives_both():
    data = bytes.fromhex("3f 70 88 02 80 00")
    assert frames.decode_position(data) == -36728
    assert frames.decode_joint_encoder(data) == 163840
    assert frames.decode_joint_encoder(data[:3]) is None


@pytest.mark.parametrize("data", ["", "00 00", "00 00 00 00", "00" * 7])
def test_a_position_that_contradicts_the_layout_is_refused(data):
    with pytest.raises(FrameError):
        frames.decode_position(bytes.fromhex(data))


@given(st.integers(-(1 << 40), 1 << 40))
def test_an_out_of_range_position_wraps_as_on_the_wire(counts):
    on_wire = frames.encode_position(counts)
    assert frames.wrap_positions([counts]) == [frames.decode_position(on_wire)]


@given(st.integers(-(2**21), 2**21 - 1))
def test_a_position_round_trips(counts):
    assert frames.decode_position(frames.encode_position(counts)) == counts


@pytest.mark.parametrize(("units", "data"), GOLDEN_TORQUES)
def test_torques_are_packed_most_significant_bit_first(units, data):
    assert frames.encode_torques(units).hex(" ") == data


def test_torques_are_floored_not_rounded():
    assert frames.decode_torques(frames.encode_torques((-64.28, 64.9, 0.0, -0.1))) == (
        (-65, 64, 0, -1)
    )


def test_the_property_number_of_old_firmware_leads_the_torques():
    assert frames.encode_torques((0, 0, 0, 0), number=9)[0] == 0x89


@given(st.tuples(int14, int14, int14, int14))
def test_torques_round_trip(units):
    assert frames.decode_torques(frames.encode_torques(units)) == units


@pytest.mark.parametrize("data", ["aa", "2a" + "00" * 7, "aa" + "00" * 8])
def test_a_frame_of_another_shape_is_not_a_torque_frame(data):
    with pytest.raises(FrameError):
        frames.decode_torques(bytes.fromhex(data))


def test_force_frame_is_little_endian_without_header():
    data = bytes.fromhex("00 01 80 fd 31 f6")
    assert frames.encode_force((1.0, -2.5, -9.81)) == data
    # Half a count is 2 mN.
    assert frames.decode_force(data) == pytest.approx((1.0, -2.5, -9.81), abs=0.002)


def test_a_force_frame_may_have_a_seventh_byte():
    data = frames.encode_force((1.0, -2.5, -9.75))
    assert frames.decode_force(data + b"\x7f") == (1.0, -2.5, -9.75)
    for size in (5, 8):
        with pytest.raises(FrameError):
            frames.decode_force(bytes(size))


def test_force_beyond_the_range_of_the_frame_is_clipped():
    clipped = frames.decode_force(frames.encode_force((200.0, -200.0, 0.0)))
    assert clipped == (0x7FFF / 256, -128.0, 0.0)


@pytest.mark.parametrize(("torque", "status", "data"), GOLDEN_SENSOR_TORQUES)
def test_sensor_torque_carries_its_status_when_there_is_one(torque, status, data):
    assert frames.encode_torque(torque, status).hex(" ") == data
    found, found_status = frames.decode_torque(bytes.fromhex(data))
    assert found == pytest.approx(torque, abs=0.00013)  # half a count
    assert found_status == (status or 0)


def test_acceleration_frame_has_its_own_scale():
    data = bytes.fromhex("00 00 00 00 3a 27")
    assert frames.encode_acceleration((0.0, 0.0, 9.80665)) == data
    # Half a count.
    assert frames.decode_acceleration(data)[2] == pytest.approx(9.80665, abs=0.0005)


@pytest.mark.parametrize(
    "decode",
    [frames.decode_force, frames.decode_torque, frames.decode_acceleration],
)
@pytest.mark.parametrize("length", [0, 5, 8])
def test_sensor_frames_of_another_length_are_refused(decode, length):
    with pytest.raises(FrameError):
        decode(bytes(length))


def test_the_seven_motors_report_under_their_own_identifiers():
    found = [frames.position_reply_id(node) for node in frames.MOTOR_NODES]
    assert found == [0x423, 0x443, 0x463, 0x483, 0x4A3, 0x4C3, 0x4E3]


def test_groups_have_their_protocol_numbers():
    assert {group.name: int(group) for group in Group} == {
        "BUS": 0,
        "LOWER_TORQUE": 1,
        "WRIST_TORQUE": 2,
        "POSITION": 3,
        "ARM": 4,
        "HAND": 5,
        "PROPERTY": 6,
        "JOINT_ENCODER": 7,
        "FORCE": 10,
        "TORQUE": 11,
        "ACCELERATION": 12,
    }


@pytest.mark.parametrize("number", [-1, 128])
def test_a_property_has_a_number_of_seven_bits(number):
    assert frames.encode_get(127) == b"\x7f"
    with pytest.raises(ValueError, match="0 to 127"):
        frames.encode_get(number)


@pytest.mark.parametrize("can_id", [0, 0x7FF])
def test_identifiers_have_eleven_bits(can_id):
    address = frames.split_id(can_id)
    assert (
        frames.compose_id(address.sender, address.to, is_group=address.is_group)
        == can_id
    )
    for beyond in (-1, 0x800):
        with pytest.raises(ValueError, match="11-bit"):
            frames.split_id(beyond)


@pytest.mark.parametrize("to", [*range(1, 9), 10])
def test_a_frame_to_a_device_is_from_a_host_whatever_its_sender_field(to):
    for sender in range(32):
        assert frames.is_host_id(frames.compose_id(sender, to, is_group=False))


@pytest.mark.parametrize("group", [0, 1, 2, 4, 5])
def test_a_group_command_is_from_a_host_whatever_its_sender_field(group):
    for sender in (0, 1, 7, 8, 20, 31):
        assert frames.is_host_id(frames.compose_id(sender, group, is_group=True))


@pytest.mark.parametrize("sender", [8, 9, 10, 20, 31])
def test_a_position_from_a_node_that_is_not_a_motor_is_from_a_host(sender):
    assert frames.is_host_id(frames.compose_id(sender, 3, is_group=True))


def test_frames_of_devices_are_not_attributed_to_a_host():
    replies = [0x426, 0x4E6, 0x506, 0x546, 0x423, 0x4E3, 0x427, 0x50A, 0x50B, 0x50C]
    hand = [frames.position_reply_id(11), frames.property_reply_id(14)]
    # A foreign node may be queried; the safety module broadcasts its mode.
    others = [frames.property_reply_id(20), frames.MODE_BROADCAST_ID]
    assert not any(map(frames.is_host_id, [*replies, *hand, *others]))
