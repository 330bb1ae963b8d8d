import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fakes.stepped import SteppedClock
from wam.bus.log import (
    CanLog,
    CanLogError,
    format_frame,
    parse_frame,
    parse_log,
    read_lines,
)

KNOWN = "(1699999999.123456) can0 404#30"
KNOWN_NS = 1_699_999_999_123_456_000


def test_a_frame_is_written_as_candump_writes_it():
    assert format_frame(KNOWN_NS, "can0", 0x404, b"\x30") == KNOWN
    assert format_frame(1_002_003, "can0", 1, b"\xaa\x0b") == (
        "(0.001002) can0 001#AA0B"
    )


@given(
    st.integers(0, 9_999_999_999_999_999),
    st.integers(0, 0x7FF),
    st.binary(max_size=8),
)
def test_a_logged_frame_round_trips_to_the_microsecond(micros, can_id, data):
    frame = parse_frame(format_frame(micros * 1000, "can0", can_id, data), 7)
    assert (frame.utc_ns, frame.can_id, frame.data) == (micros * 1000, can_id, data)
    assert (frame.channel, frame.line, frame.is_of_wam) == ("can0", 7, True)


@pytest.mark.parametrize(
    "text",
    [
        "(1.000000) can0 00000404#30",
        "(1.000000) can0 404#R",
        "(1.000000) can0 404#R1",
        "(1.000000) can0 404##130",
        "(1.000000) can0 404##1" + 64 * "AA",
    ],
)
def test_frames_of_other_kinds_are_distinguished(text):
    assert not parse_frame(text, 1).is_of_wam


def test_the_direction_that_candump_adds_is_accepted():
    assert parse_frame(KNOWN + " R", 1).data == b"\x30"


@pytest.mark.parametrize(
    "text",
    [
        "nonsense",
        "(1699999999.12345) can0 404#30",
        "(1699999999.123456) can0 804#30",
        "(1699999999.123456) can0 404#3",
        "(1699999999.123456) can0 404#001122334455667788",
        "(1699999999.123456) can0 404##13",
        "(1699999999.123456) can0 404#30 trailing",
        "(١٦٩.123456) can0 404#30",
        "(-1.123456) can0 404#30",
        KNOWN + KNOWN,
    ],
)
def test_a_malformed_line_is_reported(text):
    problems = []
    frames = list(parse_log([KNOWN, text, KNOWN], problems.append))
    assert [frame.line for frame in frames] == [1, 3]
    (problem,) = problems
    assert problem.message.startswith("Line 2 ")
    assert "candump" in problem.hint


@given(st.text(max_size=100))
def test_any_text_is_read_or_refused(text):
    try:
        frame = parse_frame(text, 1)
    except CanLogError:
        return
    assert len(frame.data) <= 8


def test_a_finer_fraction_is_read_to_the_microsecond():
    frame = parse_frame("(1699999999.123456789) can0 404#30", 1)
    assert frame.utc_ns == KNOWN_NS


def test_empty_lines_are_skipped_and_counted():
    (frame,) = parse_log(["\n", KNOWN + "\r\n"], pytest.fail)
    assert frame.line == 2


def test_frames_are_read_in_the_order_of_their_times():
    lines = [format_frame(t * 1000, "can0", t, b"") for t in (3, 1, 2, 2, 0)]
    assert [frame.can_id for frame in parse_log(lines, pytest.fail)] == [0, 1, 2, 2, 3]


def test_a_long_log_is_streamed():
    def lines():
        for t in range(300):
            yield format_frame(t * 1000, "can0", t, b"")
        pytest.fail("the first frame needed the whole log")

    assert next(parse_log(lines(), pytest.fail)).can_id == 0


def test_frames_after_a_backward_time_jump_keep_their_order():
    times = [2_000_000, 5_000_000, 1, 3, 2, 2_500_000]
    lines = [format_frame(t * 1000, "can0", k, b"") for k, t in enumerate(times)]
    frames = list(parse_log(lines, pytest.fail))
    assert [frame.can_id for frame in frames] == [0, 1, 2, 4, 3, 5]


def test_an_endless_line_counts_as_one(tmp_path):
    log = tmp_path / "bus.log"
    log.write_text(f"{KNOWN}\n{'x' * 5_000_000}\n{KNOWN}\n")
    problems = []
    with log.open() as file:
        frames = list(parse_log(read_lines(file), problems.append))
    assert [frame.line for frame in frames] == [1, 3]
    assert [problem.message[:7] for problem in problems] == ["Line 2 "]


class Sink:
    def __init__(self, error=None):
        self.text, self.error = "", error

    def write(self, text):
        if self.error:
            raise self.error
        self.text += text


def test_frames_are_written_on_request():
    sink = Sink()
    log = CanLog(sink.write, SteppedClock(), "can0")
    log.add(1, b"\x05")
    log.flush()
    log.flush()
    assert sink.text == "(1.000000) can0 001#05\n"


def test_the_memory_of_a_log_is_bounded():
    sink = Sink()
    log = CanLog(sink.write, SteppedClock(), "can0")
    for _ in range(5000):
        log.add(1, b"\x05")
    assert len(sink.text.splitlines()) == 4096


def test_monotonic_times_are_converted_to_utc():
    class OffsetClock(SteppedClock):
        def utc_ns(self):
            return self.t_ns + KNOWN_NS

    sink = Sink()
    log = CanLog(sink.write, OffsetClock(), "can0")
    log.add(1, b"", 500_000_000)
    log.flush()
    (frame,) = parse_log(sink.text.splitlines(), pytest.fail)
    assert frame.utc_ns - KNOWN_NS == 500_000_000


def test_a_failing_disk_ends_only_the_log():
    sink = Sink(OSError(28, "No space left on device"))
    log = CanLog(sink.write, SteppedClock(), "can0")
    log.add(1, b"")
    log.flush()
    assert log.failure == "No space left on device"
    sink.error = None
    log.add(1, b"")
    log.flush()
    assert sink.text == ""


def test_a_channel_name_cannot_break_the_format():
    sink = Sink()
    log = CanLog(sink.write, SteppedClock(), "my bus\n")
    log.add(1, b"")
    log.flush()
    (frame,) = parse_log(sink.text.splitlines(), pytest.fail)
    assert frame.channel == "my_bus_"
