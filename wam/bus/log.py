"""A bus log in the text format of candump: `(1699999999.123456) can0 404#30`."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from heapq import heappush, heappushpop
from typing import TextIO

from acquisition.clock import NS_PER_S, Clock, utc_offset_ns
from acquisition.errors import TractionError

LONGEST_LINE = 200  # characters; a CAN FD frame has 128 of data
# Microseconds as candump writes them; other programs write more of the fraction.
_LINE = re.compile(
    r"\((\d{1,10})\.(\d{6})\d{0,3}\) ([!-~]{1,32}) "
    r"([0-7][0-9A-F]{2}|[0-3][0-9A-F]{7})#"
    r"((?:[0-9A-F]{2}){0,8}|R[0-8]?|#[0-9A-F](?:[0-9A-F]{2}){0,64})(?: [RT])?",
    re.ASCII | re.IGNORECASE,
)
_WRITE_AT = 4096  # frames kept back at most
_REORDERED = 256  # frames; a log has replies after later questions, never by more
JUMP_NS = NS_PER_S  # back by more: the clock was set, or a second log begins


class CanLogError(TractionError):
    """A bus log that is not what it should be."""

    exit_code = 6


@dataclass(frozen=True, slots=True, order=True)
class LoggedFrame:
    """One frame of a log.

    Attributes:
        utc_ns: UTC [ns since 1970], whole microseconds.
        line: its line in the log, 1 is the first.
        channel: name of the bus.
        can_id: identifier.
        data: payload, empty for a remote frame and one of CAN FD.
        is_of_wam: a classic data frame with an 11-bit identifier; a WAM uses no
            others.
    """

    utc_ns: int
    line: int
    channel: str
    can_id: int
    data: bytes
    is_of_wam: bool = True


@dataclass(frozen=True, slots=True)
class DecodedLine:
    """A line of text and its time: UTC [ns]."""

    utc_ns: int
    text: str


@dataclass(slots=True)
class BusSummary:
    """What a log adds up to.

    Attributes:
        frames: all of them.
        foreign: frames no WAM uses: extended, remote, of CAN FD.
        questions: answers asked for; a group is asked once per member.
        answers: those that came.
        late: those that came after more than 1 ms.
        slowest_ns: the longest wait for an answer.
        unasked: answers without a question.
        jumps: times at which the log's clock goes back by more than 1 s.
        gaps: times without a frame of more than 1 s.
        longest_gap_ns: the longest of them.
        errors: what error frames of the controller reported, by name.
        silent: questions without an answer, by device and property.
    """

    frames: int = 0
    foreign: int = 0
    questions: int = 0
    answers: int = 0
    late: int = 0
    slowest_ns: int = 0
    unasked: int = 0
    jumps: int = 0
    gaps: int = 0
    longest_gap_ns: int = 0
    errors: Counter[str] = field(default_factory=Counter[str])
    silent: Counter[str] = field(default_factory=Counter[str])


_OVERHEAD, _STUFFABLE = 47, 34  # bits of a frame without data
_STUFFED = 0.1  # bits put in for each of those that may need it; at most a quarter


class BusTraffic:
    """Counts what passes on a bus; implements `wam.bus.link.Tap`.

    Attributes:
        counts: frames by identifier.
        bits: about how many bits they took.
    """

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self.bits = 0.0

    def __call__(self, frames: Sequence[tuple[int, bytes, int]]) -> None:
        """Count frames that were heard."""
        for can_id, data, _ in frames:
            self.counts[can_id] += 1
            size = 8 * len(data)
            self.bits += _OVERHEAD + size + _STUFFED * (_STUFFABLE + size)

    def load(self, seconds: float, bitrate: int) -> float:
        """Return the share of the time in which the bus was busy."""
        return self.bits / (seconds * bitrate)


def format_frame(utc_ns: int, channel: str, can_id: int, data: bytes) -> str:
    """Return the line, without its end, of a data frame with an 11-bit identifier."""
    seconds, rest_ns = divmod(utc_ns, NS_PER_S)
    return (
        f"({seconds}.{rest_ns // 1000:06d}) {channel} {can_id:03X}#{data.hex().upper()}"
    )


def parse_frame(text: str, line: int) -> LoggedFrame:
    """Return the frame of one line of a log.

    Raises:
        CanLogError: it is not in candump's format; the message names `line`.
    """
    match = _LINE.fullmatch(text)
    if match is None:
        raise CanLogError(
            f"Line {line} of the bus log is malformed: {text[:60]!r}.",
            hint="Expected candump's format, e.g. (1699999999.123456) can0 404#30.",
        )
    seconds, micros, channel, can_id, data = match.groups()
    is_other = data[:1] in ("R", "r", "#")
    return LoggedFrame(
        utc_ns=int(seconds) * NS_PER_S + int(micros) * 1000,
        line=line,
        channel=channel,
        can_id=int(can_id, 16),
        data=b"" if is_other else bytes.fromhex(data),
        is_of_wam=len(can_id) == 3 and not is_other,
    )


def read_lines(file: TextIO) -> Iterator[str]:
    """Return the lines of a log; the rest of one that is too long is passed over.

    A file without line ends must not fill the memory.
    """
    while line := file.readline(LONGEST_LINE):
        yield line
        while line and not line.endswith("\n"):
            line = file.readline(LONGEST_LINE)


def parse_log(
    lines: Iterable[str], tell: Callable[[CanLogError], None]
) -> Iterator[LoggedFrame]:
    """Return the frames of a log in the order of their times.

    Where time goes back by more than `JUMP_NS`, what follows keeps its place.

    Args:
        lines: of the log, with or without their ends.
        tell: hears of each line that is malformed, which is left out.
    """
    waiting: list[LoggedFrame] = []
    newest_ns = 0
    for number, text in enumerate(lines, 1):
        if not text.strip():
            continue
        try:
            frame = parse_frame(text.rstrip("\r\n"), number)
        except CanLogError as error:
            tell(error)
            continue
        if frame.utc_ns < newest_ns - JUMP_NS:
            yield from sorted(waiting)
            waiting, newest_ns = [], 0
        newest_ns = max(newest_ns, frame.utc_ns)
        if len(waiting) < _REORDERED:
            heappush(waiting, frame)
        else:
            yield heappushpop(waiting, frame)
    yield from sorted(waiting)


class CanLog:
    """Collects frames and writes them as text; a disk that fails ends the log only.

    Attributes:
        failure: why the log ended early, empty if it did not.
    """

    def __init__(
        self, write: Callable[[str], object], clock: Clock, channel: str
    ) -> None:
        self.failure = ""
        self._write = write
        self._clock = clock
        self._channel = re.sub(r"[^!-~]", "_", channel)[:32] or "can0"
        self._offset_ns = utc_offset_ns(clock)[0]
        self._frames: list[tuple[int, int, bytes]] = []

    def add(self, can_id: int, data: bytes, t_ns: int = 0) -> None:
        """Note a frame.

        Args:
            can_id: 11-bit identifier.
            data: payload.
            t_ns: monotonic time at which it passed [ns]; 0 = now.
        """
        utc_ns = (t_ns or self._clock.now_ns()) + self._offset_ns
        self._frames.append((utc_ns, can_id, data))
        if len(self._frames) >= _WRITE_AT:
            self.flush()

    def flush(self) -> None:
        """Write what has been noted; never raises."""
        frames, self._frames = self._frames, []
        if self.failure or not frames:
            return
        channel = self._channel
        try:
            self._write(
                "".join(f"{format_frame(t, channel, i, d)}\n" for t, i, d in frames)
            )
        except OSError as error:
            self.failure = error.strerror or str(error)
