import math
import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ft_sensor.reading import StreamTiming
from ft_sensor.serial_line.framing import FrameScanner, wire_time_ns
from ft_sensor.vendors import bota
from ft_sensor.vendors.bota import (
    Acknowledgement,
    BootText,
    BotaFrame,
    BotaStatus,
)
from tests.ft_sensor.damage import damaged_stream, double, drop, flip

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
A, B, C = (
    bytes.fromhex("AA000000 00803F00 00004000 004040CD CCCC3DCD CC4C3E9A 99993E" + tail)
    for tail in (
        "40420F00 0000C841 2E8E",
        "22470F00 0000C841 E3A6",
        "044C0F00 0000C841 207B",
    )
)

TIMING = StreamTiming(1.25e6, 802_951, bota.CLOCK_MODULUS, 1000.0, 50_000_000, 37)

float32 = st.floats(width=32, allow_nan=False)
frames = st.builds(
    BotaFrame,
    st.integers(0, 0xFFFF),
    st.tuples(*[float32] * 6),
    st.integers(0, 2**32 - 1),
    float32,
)


def parse(data: bytes, chunk: int) -> tuple[list[BotaFrame], FrameScanner[BotaFrame]]:
    parser = FrameScanner(b"\xaa", bota.FRAME_SIZE, bota.decode_frame)
    found = [
        frame
        for start in range(0, len(data), chunk)
        for frame in parser.feed(data[start : start + chunk])
    ]
    return found, parser


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
def test_fast_crc_equals_the_bitwise_one(data):
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


def test_payload_full_of_headers_decodes():
    frame = bota.decode_frame(HEADERS_INSIDE)
    assert frame is not None
    assert (frame.wrench[0], frame.device_us) == (-21.25, 0xAAAAAAAA)


@pytest.mark.parametrize("position", range(37))
def test_a_frame_with_any_byte_changed_is_none(position):
    damaged = bytearray(NORMAL)
    damaged[position] ^= 0x10
    assert bota.decode_frame(bytes(damaged)) is None


def test_a_short_frame_is_none():
    assert bota.decode_frame(NORMAL[:36]) is None
    assert bota.decode_frame(NORMAL, 1) is None


@given(frames)
def test_encoded_frames_decode_to_themselves(frame):
    assert bota.decode_frame(bota.encode_frame(frame)) == frame


@given(st.lists(frames, max_size=6), st.integers(1, 120))
def test_parser_returns_every_frame_in_any_chunking(sent, chunk):
    found, parser = parse(b"".join(map(bota.encode_frame, sent)), chunk)
    assert found == sent
    assert parser.counters.discarded == 0


def test_a_field_that_does_not_fit_is_refused():
    with pytest.raises(struct.error):
        bota.encode_frame(BotaFrame(0x10000, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0, 0.0))


@pytest.mark.parametrize("chunk", [1, 7, 44, 4096])
def test_a_lost_byte_costs_its_frame_only(chunk):
    found, parser = parse(A + B[:10] + B[11:] + C, chunk)
    assert [frame.device_us for frame in found] == [1_000_000, 1_002_500]
    assert parser.counters.discarded == 36
    assert parser.counters.resyncs == 1
    assert parser.counters.bad_checks == 1


@given(st.binary(max_size=300), st.integers(1, 80))
def test_counters_do_not_depend_on_the_chunking(noise, chunk):
    data = A + noise + b"\xaa" + B + noise + C
    found, parser = parse(data, chunk)
    whole_found, whole = parse(data, len(data))
    assert found == whole_found
    assert parser.counters == whole.counters


@given(st.binary(max_size=200))
def test_parser_holds_less_than_a_frame(noise):
    parser = FrameScanner(b"\xaa", bota.FRAME_SIZE, bota.decode_frame)
    for byte in noise + b"\xaa" * 50:
        parser.feed(bytes((byte,)))
        assert parser.held < bota.FRAME_SIZE


def noisy_frame(rng: random.Random, number: int) -> BotaFrame:
    wrench = struct.unpack(
        "<6f", struct.pack("<6f", *(rng.gauss(0, 5) for _ in "xyzabc"))
    )
    return BotaFrame(0, wrench, number * 1250, 25.0)


def header_frame(rng: random.Random, number: int) -> BotaFrame:
    (full,) = struct.unpack("<f", b"\xaa" * 4)
    return BotaFrame(
        0xAAAA, (full, full, full, full, full, full), 0xAAAA0000 + number, full
    )


@pytest.mark.parametrize("chunk", [1, 7, 44, 1 << 20])
@pytest.mark.parametrize("make", [noisy_frame, header_frame])
@pytest.mark.parametrize("fault", [flip, drop])
def test_one_bad_byte_costs_exactly_one_frame(make, fault, chunk):
    for seed in range(10):
        data, sent, hit = damaged_stream(make, bota.encode_frame, fault, seed)
        found, _ = parse(data, chunk)
        assert found == [f for number, f in enumerate(sent) if number not in hit]


@pytest.mark.parametrize("chunk", [1, 7, 44, 1 << 20])
@pytest.mark.parametrize("make", [noisy_frame, header_frame])
def test_a_doubled_byte_costs_at_most_one_frame(make, chunk):
    for seed in range(10):
        data, sent, hit = damaged_stream(make, bota.encode_frame, double, seed)
        found, parser = parse(data, chunk)
        got = {frame.device_us for frame in found}
        lost = {n for n, frame in enumerate(sent) if frame.device_us not in got}
        assert lost <= hit
        assert [f for n, f in enumerate(sent) if n not in lost] == found
        assert parser.counters.discarded > 0


def test_device_time_unwraps_over_the_end_of_32_bits():
    assert TIMING.unwrap(100, 2**32 - 1150) == 2**32 + 100
    assert TIMING.unwrap(100, 5 * 2**32 + 50) == 5 * 2**32 + 100


def test_device_time_that_steps_back_stays_a_step_back():
    assert TIMING.unwrap(2**32 - 10, 2**32 + 5) == 2**32 - 10


def test_status_is_told_in_words():
    words = bota.status_words(BotaStatus.OVER_RANGE | BotaStatus.RAW_GAUGE | 0x100)
    assert len(words) == 3
    assert "range exceeded" in words[0]
    assert "raw gauge" in words[1]
    assert "0x0100" in words[2]
    assert bota.status_words(0) == ()


def test_commands_are_the_documented_bytes():
    assert bota.communication_command(460800) == bytes.fromhex("632C302C312C302C34")
    assert bota.filter_command(64, True) == bytes.fromhex("662C36342C302C302C30")
    assert bota.filter_command(205, False) == b"f,205,0,0,1"


def test_acknowledgement_is_found_between_frames():
    data = NORMAL[5:] + bytes.fromhex("722C302C432C30") + HEADERS_INSIDE
    assert bota.find_acknowledgements(data) == [Acknowledgement("C", 0)]


def test_acknowledgement_cut_short_is_not_yet_one():
    assert bota.find_acknowledgements(NORMAL + b"r,0,C,") == []


def test_acknowledgement_survives_a_hostile_code():
    (answer,) = bota.find_acknowledgements(b"r,0,f," + b"9" * 5000)
    assert answer.code != 0


@given(st.sampled_from("CRIcf"), st.integers(0, 99))
def test_acknowledgements_decode_to_themselves(letter, code):
    answer = Acknowledgement(letter, code)
    data = bota.encode_acknowledgement(answer)
    assert bota.find_acknowledgements(data) == [answer]


def test_boot_text_is_found_with_any_line_end():
    data = b"\x00junk App Init\r\nname: SensX\rS/N: 123\r\nFW version: 2.1 b\n"
    text = bota.find_boot_text(data)
    assert text == BootText(True, "SensX", "123", "2.1 b")
    assert text.is_complete


def test_boot_text_waits_for_the_end_of_a_line():
    text = bota.find_boot_text(b"App Init\r\nname: SensX\rFW version: 2.")
    assert text.is_started
    assert not text.is_complete


def test_wire_time_of_a_frame_is_four_fifths_of_a_millisecond():
    assert wire_time_ns(37, 460800) == 802_951


def test_rate_is_51200_over_the_sinc_length():
    assert 1e9 / bota.frame_period_ns(64) == 800.0
    assert 1e9 / bota.frame_period_ns(51) == pytest.approx(1003.92, abs=0.01)
