"""Scanner for frames of fixed size in a possibly damaged byte stream.

The decoder of each vendor verifies the checksum (a CRC or a sum) of its frames.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

F = TypeVar("F")

BITS_PER_BYTE = 10  # 8N1: a start bit, eight data bits, a stop bit


@dataclass(slots=True)
class ScanCounters:
    """Counters of a scanner.

    Attributes:
        frames: good frames.
        bad_checks: headers whose frame failed its checks; one damaged frame counts
            once for every header pattern in it.
        discarded: bytes outside good frames.
        resyncs: losses of synchronisation.
    """

    frames: int = 0
    bad_checks: int = 0
    discarded: int = 0
    resyncs: int = 0


class FrameScanner(Generic[F]):
    """Finds frames by header, size and check.

    After a failed check the search continues one byte later, so that one damaged byte
    costs one frame. Less than one frame is buffered between calls.
    """

    def __init__(
        self, header: bytes, size: int, decode: Callable[[bytes, int], F | None]
    ) -> None:
        """Search for `header`; `decode(data, index)` decodes `size` bytes, or None."""
        self.counters = ScanCounters()
        self._header = header
        self._size = size
        self._decode = decode
        self._held = b""
        self._is_lost = False

    @property
    def held(self) -> int:
        """Number of buffered bytes of an incomplete frame."""
        return len(self._held)

    def feed(self, data: bytes) -> list[F]:
        """Return the frames completed by `data`, oldest first."""
        frames: list[F] = []
        start = 0
        if self._held:
            # A frame that begins in the held bytes ends within size - 1 more bytes.
            held = len(self._held)
            boundary = self._held + data[: self._size - 1]
            reached = self._scan(boundary, 0, held, frames)
            if reached < held:
                self._held = boundary[reached:]
                return frames
            start = reached - held
        self._held = data[self._scan(data, start, len(data), frames) :]
        return frames

    def _scan(self, data: bytes, start: int, stop: int, frames: list[F]) -> int:
        """Append the frames that begin in [start, stop); return the next index."""
        counters, size, decode = self.counters, self._size, self._decode
        while start < stop:
            begin = self._find_header(data, start, stop)
            if begin != start:
                self._discard(begin - start)
                start = begin
                continue
            if len(data) - start < size:
                break
            frame = decode(data, start)
            if frame is None:
                counters.bad_checks += 1
                self._discard(1)
                start += 1
            else:
                frames.append(frame)
                counters.frames += 1
                self._is_lost = False
                start += size
        return start

    def _find_header(self, data: bytes, start: int, stop: int) -> int:
        """Return the index of the next header, possibly incomplete, or `stop`."""
        header = self._header
        at = data.find(header, start, stop + len(header) - 1)
        if at >= 0:
            return at
        # The last bytes may be the beginning of a header.
        at = max(start, len(data) - len(header) + 1)
        while at < stop and not header.startswith(data[at:]):
            at += 1
        return min(at, stop)

    def _discard(self, count: int) -> None:
        self.counters.discarded += count
        if not self._is_lost:
            self._is_lost = True
            self.counters.resyncs += 1


def wire_time_ns(size: int, baudrate: int) -> int:
    """Return the transmission time of `size` bytes [ns]."""
    return size * BITS_PER_BYTE * 1_000_000_000 // baudrate
