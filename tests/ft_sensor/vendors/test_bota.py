import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ft_sensor.reading import StreamTiming
from ft_sensor.serial_line.framing import wire_time_ns
from ft_sensor.vendors import bota
from ft_sensor.vendors.bota import (
    Acknowledgement,
    BootText,
    BotaFrame,
    BotaStatus,
)

NORMAL = bytes.fromhex(
    "AA000000 00A03F00 0020C000 00204100 00003E000080BD00 00003F87 D6120000 00CC4109 37"
)
OVER_RANGE = bytes.fromhex(
    "AA020000 00A03F00 0020C000 00204100 00003E000080BD00 00003F6F DA120000 00CC4176 10"
)
HEADERS_INSIDE = bytes.fromhex(
    "AA000000 00AAC100 00000000 00000000 0000000000000000 000000AA AAAAAA00 00C8414F 4C"
)
RAW_GAUGE = bytes.fromhex(
    "AA080000 20F14700 90F6C500 9CAD4600 00A0400000C04000 00E04040 420F0000 00C8415F A2"
)
INVALID = bytes.fromhex(
    "AA040000 00C07F00 00C07F00 00C07F00 00C07F0000C07F00 00C07F40 420F0000 00C8417D A8"
)

TIMING = StreamTiming(1.25e6, 802_951, bota.CLOCK_MODULUS, 1000.0, 50_000_000, 37)


def bitwise_x25(data: bytes) -> int:
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc ^ 0xFFFF


def test_crc_gives_the_published_check_value():
    assert bota.crc_x25(b"123456789") == 0x906E


@given(st.binary(max_size=64))
def test_the_table_crc_equals_the_bitwise_one(data):
    assert bota.crc_x25(data) == bitwise_x25(data)


def test_normal_frame_decodes_to_its_load():
    frame = BotaFrame(0, (1.25, -2.5, 10.0, 0.125, -0.0625, 0.5), 1_234_567, 25.5)
    assert bota.decode_frame(NORMAL) == frame
    assert bota.encode_frame(frame) == NORMAL


@pytest.mark.parametrize(
    ("golden", "status"),
    [(OVER_RANGE, BotaStatus.OVER_RANGE), (RAW_GAUGE, BotaStatus.RAW_GAUGE)],
)
def test_flagged_frames_decode_and_encode_again(golden, status):
    frame = bota.decode_frame(golden)
    assert frame is not None
    assert frame.status == status
    assert bota.encode_frame(frame) == golden


def test_invalid_frame_carries_no_numbers():
    frame = bota.decode_frame(INVALID)
    assert frame is not None
    assert frame.status == BotaStatus.INVALID
    assert all(map(math.isnan, frame.wrench))


def test_a_payload_full_of_headers_decodes():
    frame = bota.decode_frame(HEADERS_INSIDE)
    assert frame is not None
    assert (frame.wrench[0], frame.device_us) == (-21.25, 0xAAAAAAAA)


def test_a_short_frame_is_rejected():
    assert bota.decode_frame(NORMAL[:36]) is None
    assert bota.decode_frame(NORMAL, 1) is None


def test_a_field_out_of_range_is_refused():
    with pytest.raises(struct.error):
        bota.encode_frame(BotaFrame(0x10000, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0, 0.0))


def test_device_time_unwraps_across_32_bits():
    assert TIMING.unwrap(100, 2**32 - 1150) == 2**32 + 100
    assert TIMING.unwrap(100, 5 * 2**32 + 50) == 5 * 2**32 + 100


def test_a_backward_step_of_device_time_is_kept():
    assert TIMING.unwrap(2**32 - 10, 2**32 + 5) == 2**32 - 10


def test_a_status_is_described():
    words = bota.status_texts(BotaStatus.OVER_RANGE | BotaStatus.RAW_GAUGE | 0x100)
    assert len(words) == 3
    assert "range exceeded" in words[0]
    assert "raw gauge" in words[1]
    assert "0x0100" in words[2]
    assert bota.status_texts(0) == ()


def test_commands_are_the_documented_bytes():
    assert bota.communication_command(460800) == bytes.fromhex("632C302C312C302C34")
    assert bota.filter_command(64, True) == bytes.fromhex("662C36342C302C302C30")
    assert bota.filter_command(205, False) == b"f,205,0,0,1"


def test_acknowledgement_is_found_between_frames():
    data = NORMAL[5:] + bytes.fromhex("722C302C432C30") + HEADERS_INSIDE
    assert bota.find_acknowledgements(data) == [Acknowledgement("C", 0)]


def test_a_truncated_acknowledgement_is_not_yet_accepted():
    assert bota.find_acknowledgements(NORMAL + b"r,0,C,") == []


def test_acknowledgement_survives_a_hostile_code():
    (answer,) = bota.find_acknowledgements(b"r,0,f," + b"9" * 5000)
    assert answer.code != 0


@given(st.sampled_from("CRIcf"), st.integers(0, 99))
def test_acknowledgements_round_trip(letter, code):
    answer = Acknowledgement(letter, code)
    data = bota.encode_acknowledgement(answer)
    assert bota.find_acknowledgements(data) == [answer]


def test_boot_text_is_found_with_any_line_ending():
    data = b"\x00junk App Init\r\nname: SensX\rS/N: 123\r\nFW version: 2.1 b\n"
    text = bota.find_boot_text(data)
    assert text == BootText(True, "SensX", "123", "2.1 b")
    assert text.is_complete


def test_boot_text_waits_for_the_end_of_a_line():
    text = bota.find_boot_text(b"App Init\r\nname: SensX\rFW version: 2.")
    assert text.is_started
    assert not text.is_complete


def test_the_wire_time_of_a_frame_follows_from_the_baud_rate():
    assert wire_time_ns(37, 460800) == 802_951


def test_rate_is_51200_over_the_sinc_length():
    assert 1e9 / bota.frame_period_ns(64) == 800.0
    assert 1e9 / bota.frame_period_ns(51) == pytest.approx(1003.92, abs=0.01)
