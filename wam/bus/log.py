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
_WRITE_AT = 4096  # frames buffered
_REORDERED = 256  # frames; bounds how far replies stand behind later requests
JUMP_NS = NS_PER_S  # a larger step back: the clock was set, or a second log begins


class CanLogError(TractionError):
    """A malformed bus log."""

    exit_code = 6


@dataclass(frozen=True, slots=True, order=True)
class LoggedFrame:
    """One frame of a log.

    Attributes:
        utc_ns: UTC [ns since 1970], whole microseconds.
        line: line number in the log, from 1.
        channel: name of the bus.
        can_id: identifier.
        data: payload, empty for remote and CAN FD frames.
        is_of_wam: a classic data frame with an 11-bit identifier, the only kind that
            a WAM uses.
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
    """Totals of a log.

    Attributes:
        frames: number of frames.
        foreign: frames that no WAM uses: extended, remote, CAN FD.
        questions: replies requested; a group request counts once per member.
        answers: replies to a request.
        late: replies after more than 1 ms.
        slowest_ns: longest reply time.
        unsolicited: replies without a request.
        jumps: steps back of the log's clock by more than 1 s.
        gaps: intervals of more than 1 s without a frame.
        longest_gap_ns: longest of them.
        errors: errors reported by the CAN controller, by name.
        unanswered: requests without a reply, by device and property.
    """

    frames: int = 0
    foreign: int = 0
    questions: int = 0
    answers: int = 0
    late: int = 0
    slowest_ns: int = 0
    unsolicited: int = 0
    jumps: int = 0
    gaps: int = 0
    longest_gap_ns: int = 0
    errors: Counter[str] = field(default_factory=Counter[str])
    unanswered: Counter[str] = field(default_factory=Counter[str])


_OVERHEAD, _STUFFABLE = 47, 34  # bits of a frame without data
_STUFFED = 0.1  # mean stuff bits per stuffable bit; 0.25 is the worst case


class BusTraffic:
    """Bus load counter; implements `wam.bus.link.Tap`.

    Attributes:
        counts: frames by identifier.
        bits: estimated bits on the wire.
    """

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self.bits = 0.0

    def __call__(self, frames: Sequence[tuple[int, bytes, int]]) -> None:
        """Count frames."""
        for can_id, data, _ in frames:
            self.counts[can_id] += 1
            size = 8 * len(data)
            self.bits += _OVERHEAD + size + _STUFFED * (_STUFFABLE + size)

    def load(self, seconds: float, bitrate: int) -> float:
        """Return the bus load as a share of 1, over `seconds` at `bitrate` [bit/s]."""
        return self.bits / (seconds * bitrate)


def format_frame(utc_ns: int, channel: str, can_id: int, data: bytes) -> str:
    """Return the log line of an 11-bit data frame, without the newline."""
    seconds, fraction_ns = divmod(utc_ns, NS_PER_S)
    time = f"{seconds}.{fraction_ns // 1000:06d}"
    return f"({time}) {channel} {can_id:03X}#{data.hex().upper()}"


def parse_frame(text: str, line: int) -> LoggedFrame:
    """Return the frame of one line of a log.

    Raises:
        CanLogError: the line is not in candump's format; the message names `line`.
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
    """Yield the lines of a log, truncated to `LONGEST_LINE` characters.

    The limit keeps a file without newlines from filling the memory.
    """
    while line := file.readline(LONGEST_LINE):
        yield line
        while line and not line.endswith("\n"):
            line = file.readline(LONGEST_LINE)


def parse_log(
    lines: Iterable[str], tell: Callable[[CanLogError], None]
) -> Iterator[LoggedFrame]:
    """Yield the frames of a log sorted by time.

    Sorting restarts where time steps back by more than `JUMP_NS`.

    Args:
        lines: lines of the log, with or without newlines.
        tell: called with the error of each malformed line, which is skipped.
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
    """Buffered writer of a bus log; a disk error ends the log and nothing else.

    Attributes:
        failure: error that ended the log early, "" if there was none.
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
        """Buffer a frame.

        Args:
            can_id: 11-bit identifier.
            data: payload.
            t_ns: monotonic time on the bus [ns]; 0 = now.
        """
        utc_ns = (t_ns or self._clock.now_ns()) + self._offset_ns
        self._frames.append((utc_ns, can_id, data))
        if len(self._frames) >= _WRITE_AT:
            self.flush()

    def flush(self) -> None:
        """Write the buffered frames; never raises."""
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
