"""Frames of every serial sensor are found in any chunks and despite damage."""

import random
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ft_sensor.serial_line.framing import FrameScanner
from ft_sensor.vendors import bota, optoforce, robotous
from ft_sensor.vendors.bota import BotaFrame
from ft_sensor.vendors.optoforce import OptoForceFrame
from ft_sensor.vendors.robotous import RobotousFrame
from tests.ft_sensor.damage import damaged_stream, double, drop, flip, parse

CHUNKS = (1, 7, 44, 1 << 20)
COUNT, WORD = st.integers(-32768, 32767), st.integers(0, 0xFFFF)
FLOAT = st.floats(width=32, allow_nan=False)


@dataclass(frozen=True)
class Framing:
    """Frames of one make.

    Attributes:
        header: first bytes of each frame.
        size: of each frame [bytes].
        encode: function from a frame to bytes.
        decode: function from bytes to a frame, or None.
        frames: strategy for any frame.
        noisy: function to a frame of random numbers, different for each number.
    """

    header: bytes
    size: int
    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], Any]
    frames: st.SearchStrategy
    noisy: Callable[[random.Random, int], Any]

    def scanner(self) -> FrameScanner:
        return FrameScanner(self.header, self.size, self.decode)


def bota_noise(rng, number):
    packed = struct.pack("<6f", *(rng.gauss(0, 5) for _ in range(6)))
    return BotaFrame(0, struct.unpack("<6f", packed), number * 1250, 25.0)


def bota_headers(_, number):
    """Return a frame that is full of headers."""
    (full,) = struct.unpack("<f", b"\xaa" * 4)
    return BotaFrame(0xAAAA, (full,) * 6, 0xAAAA0000 + number, full)


def six(rng):
    return tuple(rng.randrange(-2000, 2000) for _ in range(6))


BOTA = Framing(
    b"\xaa",
    bota.FRAME_SIZE,
    bota.encode_frame,
    bota.decode_frame,
    st.builds(
        BotaFrame, WORD, st.tuples(*[FLOAT] * 6), st.integers(0, 2**32 - 1), FLOAT
    ),
    bota_noise,
)
FRAMINGS = {
    "bota": BOTA,
    "bota, headers inside": Framing(
        BOTA.header, BOTA.size, BOTA.encode, BOTA.decode, BOTA.frames, bota_headers
    ),
    "robotous": Framing(
        b"\x55",
        robotous.FRAME_SIZE,
        robotous.encode_frame,
        robotous.decode_frame,
        st.builds(RobotousFrame, st.tuples(*[COUNT] * 6), st.integers(0, 63)),
        lambda rng, number: RobotousFrame((number, *six(rng)[1:]), 0),
    ),
    "optoforce": Framing(
        optoforce.HEADER,
        optoforce.FRAME_SIZE,
        optoforce.encode_frame,
        optoforce.decode_frame,
        st.builds(OptoForceFrame, WORD, WORD, st.tuples(*[COUNT] * 6)),
        lambda rng, number: OptoForceFrame(number, 0, six(rng)),
    ),
}


@pytest.fixture(params=FRAMINGS)
def framing(request):
    return FRAMINGS[request.param]


@pytest.mark.parametrize("name", FRAMINGS)
@given(data=st.data())
def test_frames_are_decoded_in_any_chunking(name, data):
    framing = FRAMINGS[name]
    sent = data.draw(st.lists(framing.frames, max_size=6))
    scanner = framing.scanner()
    stream = b"".join(map(framing.encode, sent))
    assert parse(scanner, stream, data.draw(st.integers(1, 120))) == sent
    assert scanner.counters.discarded == 0


@pytest.mark.parametrize("name", FRAMINGS)
@given(noise=st.binary(max_size=200), chunk=st.integers(1, 80))
def test_result_and_counters_do_not_depend_on_the_chunking(name, noise, chunk):
    framing = FRAMINGS[name]
    frame = framing.encode(framing.noisy(random.Random(1), 1))
    stream = frame + noise + framing.header + frame + noise + frame
    pieces, whole = framing.scanner(), framing.scanner()
    assert parse(pieces, stream, chunk) == parse(whole, stream, len(stream))
    assert pieces.counters == whole.counters


@pytest.mark.parametrize("name", FRAMINGS)
@given(noise=st.binary(max_size=200))
def test_a_scanner_holds_less_than_a_frame(name, noise):
    framing = FRAMINGS[name]
    scanner = framing.scanner()
    for byte in noise + framing.header * 50:
        scanner.feed(bytes((byte,)))
        assert scanner.held < framing.size


def test_a_frame_with_any_byte_changed_is_rejected(framing):
    frame = framing.encode(framing.noisy(random.Random(2), 3))
    for position in range(framing.size):
        damaged = bytearray(frame)
        damaged[position] ^= 0x10
        assert framing.decode(bytes(damaged)) is None


@pytest.mark.parametrize("chunk", CHUNKS)
@pytest.mark.parametrize("fault", [flip, drop])
def test_one_bad_byte_costs_exactly_one_frame(framing, fault, chunk):
    for seed in range(10):
        data, sent, hit = damaged_stream(framing.noisy, framing.encode, fault, seed)
        kept = [frame for number, frame in enumerate(sent) if number not in hit]
        assert parse(framing.scanner(), data, chunk) == kept


@pytest.mark.parametrize("chunk", CHUNKS)
def test_a_doubled_byte_costs_at_most_one_frame(framing, chunk):
    for seed in range(10):
        data, sent, hit = damaged_stream(framing.noisy, framing.encode, double, seed)
        found = parse(framing.scanner(), data, chunk)
        lost = {number for number, frame in enumerate(sent) if frame not in found}
        assert lost <= hit
        assert found == [f for number, f in enumerate(sent) if number not in lost]
