from itertools import pairwise

import numpy as np
import pytest

from fakes.sensor.bota import BotaOptions, bota_stream
from fakes.sensor.errors import SensorErrors
from fakes.sensor.stream import ByteFault, SensorStream, damage
from ft_sensor.serial_line.framing import FrameScanner
from ft_sensor.vendors.bota import (
    Acknowledgement,
    BotaStatus,
    decode_frame,
    find_acknowledgements,
    find_boot_text,
)

MS = 1_000_000
S = 1_000_000_000
WIRE_NS = 802_951  # 37 bytes of 10 bits at 460800 baud
FAST = BotaOptions(is_running=True, sinc=64)


def ramp(t_ns: int) -> tuple[float, ...]:
    """Return a load that encodes the time of its sampling in whole microseconds."""
    return (t_ns / 1000, 1.0, 2.0, 3.0, 4.0, 5.0)


def parsed(data: bytes):
    return FrameScanner(b"\xaa", 37, decode_frame).feed(data)


def frames_of(stream: SensorStream, t_ns: int):
    return parsed(text_of(stream, t_ns))


def text_of(stream: SensorStream, t_ns: int) -> bytes:
    return b"".join(data for _, data in stream.due(t_ns))


def configured(options: BotaOptions = FAST) -> SensorStream:
    """Return a device in configuration mode at 100 ms, without pending output."""
    stream = bota_stream(ramp, options=options)
    stream.receive(50 * MS, b"C")
    stream.due(100 * MS)
    return stream


def test_a_frame_arrives_when_its_last_byte_is_sent():
    stream = bota_stream(ramp, options=FAST)
    assert stream.due(WIRE_NS - 1) == []
    ((t_ns, data),) = stream.due(WIRE_NS)
    assert (t_ns, len(data)) == (WIRE_NS, 37)


def test_the_next_event_is_the_next_arrival():
    stream = bota_stream(ramp, options=FAST)
    for _ in range(5):
        event = stream.next_event_ns()
        assert event is not None
        assert stream.due(event - 1) == []
        assert len(stream.due(event)) == 1


def test_a_frame_has_the_load_of_its_sampling_instant():
    frames = frames_of(bota_stream(ramp, options=FAST), 100 * MS)
    assert [frame.wrench[0] for frame in frames] == [1250.0 * k for k in range(80)]
    assert all(frame.wrench[0] == frame.device_us for frame in frames)


@pytest.mark.parametrize("steps", [1, 3, 1000])
def test_bytes_do_not_depend_on_how_often_they_are_fetched(steps):
    def sent(count: int) -> bytes:
        errors = SensorErrors(np.random.default_rng(5))
        stream = bota_stream(ramp, errors, FAST)
        return b"".join(text_of(stream, S // count * k) for k in range(1, count + 1))

    whole = sent(1)
    part = sent(steps)
    # A step may end before the last frame of the whole second.
    assert whole.startswith(part)
    assert len(whole) - len(part) <= 37


@pytest.mark.parametrize(("sinc", "rate"), [(51, 1003.9), (64, 800), (512, 100)])
def test_rate_is_51200_over_the_sinc_length(sinc, rate):
    stream = bota_stream(ramp, options=BotaOptions(is_running=True, sinc=sinc))
    assert len(frames_of(stream, 10 * S)) == pytest.approx(10 * rate, abs=1)


def test_shipped_device_sends_100_hz():
    stream = bota_stream(ramp, options=BotaOptions(is_running=True))
    assert len(stream.due(S)) == pytest.approx(100, abs=1)


def test_a_fast_device_clock_runs_ahead():
    options = BotaOptions(is_running=True, sinc=64, clock_error_ppm=200)
    frames = frames_of(bota_stream(ramp, options=options), 10 * S)
    host_us = frames[-1].wrench[0]
    # 200 ppm of 10 s are 2000 us; float32 shows ten million to one.
    assert frames[-1].device_us - host_us == pytest.approx(2000, abs=3)
    # The device samples by its own clock.
    assert frames[-1].device_us == pytest.approx(1250 * (len(frames) - 1), abs=1)


def test_device_clock_wraps_at_32_bits():
    options = BotaOptions(is_running=True, sinc=64, clock_start_us=2**32 - 1250)
    frames = frames_of(bota_stream(ramp, options=options), 4 * MS)
    assert [frame.device_us for frame in frames] == [2**32 - 1250, 0, 1250]


def test_boot_text_is_delayed_and_precedes_the_stream():
    stream = bota_stream(ramp)
    assert stream.due(300 * MS) == []
    text = find_boot_text(text_of(stream, 900 * MS))
    assert text == BotaOptions().boot_text
    assert frames_of(stream, 2 * S)


def test_commands_during_the_boot_are_lost():
    stream = bota_stream(ramp)
    stream.receive(500 * MS, b"C")
    data = text_of(stream, 3 * S)
    assert find_acknowledgements(data) == []
    assert parsed(data)


def test_configuration_mode_stops_the_stream_after_a_whole_frame():
    stream = bota_stream(ramp, options=FAST)
    stream.due(10 * MS)
    stream.receive(10 * MS + 100_000, b"C")
    data = text_of(stream, S)
    assert len(parsed(data)) == 1
    assert data.endswith(b"r,0,C,0")
    assert stream.next_event_ns() is None


def test_commands_may_arrive_byte_by_byte():
    stream = configured()
    for k, byte in enumerate(b"f,64,0,0,0"):
        stream.receive(100 * MS + k * 5 * MS, bytes((byte,)))
    assert text_of(stream, S) == b"r,0,f,0"


def test_filter_command_sets_the_rate():
    stream = configured(BotaOptions(is_running=True))
    stream.receive(100 * MS, b"f,64,0,0,0R")
    assert len(frames_of(stream, S + 104 * MS)) == pytest.approx(800, abs=1)


@pytest.mark.parametrize("command", [b"c,0,1,0,4", b"f,64,0,0,0", b"R"])
def test_configuring_while_running_is_refused(command):
    stream = bota_stream(ramp, options=FAST)
    stream.receive(50 * MS, command)
    answers = find_acknowledgements(text_of(stream, 100 * MS))
    assert answers == [Acknowledgement(chr(command[0]), 1)]
    assert frames_of(stream, S)


@pytest.mark.parametrize(
    "noise", [b"\x00\xff", b"xyz", b"c,0,1,x", b"f,,,,", b"c" * 99]
)
def test_unknown_input_does_not_hide_the_next_command(noise):
    stream = configured()
    stream.receive(100 * MS, noise + b"f,64,0,0,0")
    assert find_acknowledgements(text_of(stream, S)) == [Acknowledgement("f", 0)]


def test_refused_letters_are_answered_with_a_code():
    stream = configured(BotaOptions(is_running=True, sinc=64, refused="R"))
    stream.receive(100 * MS, b"R")
    assert find_acknowledgements(text_of(stream, S)) == [Acknowledgement("R", 1)]


def test_a_device_that_ignores_commands_keeps_streaming():
    stream = bota_stream(
        ramp, options=BotaOptions(is_running=True, sinc=64, is_deaf=True)
    )
    stream.receive(0, b"C")
    assert find_acknowledgements(text_of(stream, S)) == []
    assert frames_of(stream, 2 * S)


def test_raw_starts_show_in_the_status_until_reset():
    stream = bota_stream(
        ramp, options=BotaOptions(is_running=True, sinc=64, raw_starts=1)
    )
    assert {f.status for f in frames_of(stream, 50 * MS)} == {BotaStatus.RAW_GAUGE}
    stream.receive(50 * MS, b"I")
    stream.receive(60 * MS, b"R")
    assert frames_of(stream, 100 * MS)[-1].status == 0


def test_hard_reset_boots_again_with_its_clock_at_zero():
    stream = bota_stream(ramp, options=FAST)
    stream.due(S)
    stream.receive(S, b"#")
    data = text_of(stream, 3 * S)
    assert find_boot_text(data).is_complete
    (first, *_) = parsed(data)
    assert first.device_us == 1_000_000  # from reset to the first sample


def test_a_silent_device_sends_nothing_until_restored():
    stream = bota_stream(ramp, options=FAST)
    stream.go_silent()
    assert stream.due(S) == []
    assert stream.next_event_ns() is None
    stream.speak()
    assert stream.due(2 * S)


def test_paused_device_loses_samples_but_no_time():
    stream = bota_stream(ramp, options=FAST)
    stream.pause(50 * MS)
    assert frames_of(stream, 60 * MS)[0].device_us == 50_000


def test_a_line_that_is_too_slow_skips_and_flags_samples():
    options = BotaOptions(is_running=True, sinc=64, baudrate=115200)
    frames = frames_of(bota_stream(ramp, options=options), S)
    assert len(frames) <= 311  # what 115200 baud can carry
    assert any(frame.status & BotaStatus.SKIPPED for frame in frames)


@pytest.mark.parametrize("fault", list(ByteFault))
def test_damage_hits_one_frame(fault):
    stream = bota_stream(ramp, options=FAST)
    stream.due(10 * MS)  # the sample of 10 ms is on the wire
    stream.damage_next(fault, 12)
    frames = frames_of(stream, 60 * MS)
    steps = [b.device_us - a.device_us for a, b in pairwise(frames)]
    assert steps == [2500] + [1250] * (len(frames) - 2)


def test_each_kind_of_damage_has_its_effect():
    assert damage(b"abc", ByteFault.FLIP, 1) == b"acc"
    assert damage(b"abc", ByteFault.DROP, 1) == b"ac"
    assert damage(b"abc", ByteFault.DOUBLE, 1) == b"abbc"
