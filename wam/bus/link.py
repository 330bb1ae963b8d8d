"""CAN link of the driver: device frames in, all other frames counted and dropped."""

import errno
from collections.abc import Callable, Sequence
from functools import partial
from operator import itemgetter
from typing import NamedTuple, Protocol

from acquisition.clock import NS_PER_S
from acquisition.errors import LinkError, LinkFullError
from wam.bus.error_frames import ERROR_FLAG, BusErrors
from wam.bus.frames import MODE_BROADCAST_ID, is_host_id

_FULL = frozenset({errno.ENOBUFS, errno.EAGAIN})  # send queue full, socket buffer full
MAX_DRAINED_FRAMES = 512  # frames; bounds the time of a cycle when the bus is flooded
_PLAUSIBLE_NS = 10 * NS_PER_S  # an older timestamp comes from another clock
_AHEAD_NS = 5_000_000  # frames keep arriving while the bus is drained
_LARGEST_ID = 0x7FF  # 11-bit identifiers; the WAM uses no others
_DEVICE_IDS = frozenset(
    can_id
    for can_id in range(_LARGEST_ID + 1)
    if not is_host_id(can_id) and can_id != MODE_BROADCAST_ID
)
_can_id = itemgetter(0)


class Frame(NamedTuple):
    """A frame as received or sent.

    Attributes:
        can_id: 11-bit identifier; transports OR in Linux's flags for error, extended
            and remote frames.
        data: payload.
        t_ns: time on the bus by the host's monotonic clock [ns], 0 = not known.
    """

    can_id: int
    data: bytes
    t_ns: int


as_frame = partial(tuple[int | bytes].__new__, Frame)  # skips NamedTuple's __new__
Tap = Callable[[Sequence[tuple[int, bytes, int]]], None]  # of tuples like Frame


class Transport(Protocol):
    """Adapter interface of a link: sends and receives frames of all kinds.

    Attributes:
        name: human-readable name.
        lost: received frames dropped for lack of buffer space, if the adapter counts.
    """

    name: str
    lost: int

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier.

        Raises:
            LinkFullError: the queue is full.
            LinkError: the bus is down.
        """
        ...

    def receive(self) -> list[Frame]:
        """Return the queued frames, oldest first, without blocking.

        Raises:
            LinkError: the bus is down.
        """
        ...

    def has_unsent(self) -> bool:
        """Return whether frames wait in the send queue; False if it is not known."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""
        ...

    def close(self) -> None:
        """Release the adapter."""
        ...


class Link(Protocol):
    """Bus interface of the driver."""

    @property
    def mode_hints(self) -> int:
        """Number of mode changes announced by the safety module."""
        ...

    @property
    def errors(self) -> BusErrors:
        """Error counters and condition of the bus."""
        ...

    @property
    def foreign_id(self) -> int | None:
        """Identifier of the first frame from another bus master, or None."""
        ...

    def metadata(self) -> dict[str, str]:
        """Return transport name and number of lost frames, as text for a recording."""
        ...

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a frame; raises LinkError when the bus refuses it."""
        ...

    def receive(self) -> list[Frame]:
        """Return the device frames received, oldest first, without blocking."""
        ...

    def has_unsent(self) -> bool:
        """Return whether frames wait in the send queue; False if it is not known."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""
        ...

    def is_readable(self) -> bool:
        """Return whether `receive` would return a frame."""
        ...

    def close(self) -> None:
        """Release the bus."""
        ...


class CanLink:
    """Non-blocking CAN link that passes device frames to the driver.

    Frames of hosts (`is_host_id`), remote, extended and error frames are dropped. The
    content of the safety module's mode broadcast is undocumented: it is counted in
    `mode_hints` and dropped. A bus does not echo frames sent through it, so a received
    host frame is another master's.

    Attributes:
        mode_hints: mode broadcasts of the safety module so far.
        errors: error counters and condition of the bus.
        foreign_ids: identifiers of the host frames received so far.
        foreign_id: the first of them; None if there is none.
    """

    def __init__(self, transport: Transport, tap: Tap | None = None) -> None:
        """Take ownership of a transport.

        Args:
            transport: adapter of the bus.
            tap: called with every data frame with an 11-bit identifier, sent or
                received; frames received together come in one call.
        """
        self._tap = tap
        self.mode_hints = 0
        self.errors = BusErrors()
        self.foreign_ids: set[int] = set()
        self.foreign_id: int | None = None
        self._transport = transport
        self._inbox: list[Frame] = []
        self._error: LinkError | None = None  # met by is_readable, raised by receive
        self._is_open = True

    def metadata(self) -> dict[str, str]:
        """Return transport name and number of lost frames, as text for a recording."""
        return {  # "door" is a key of format 1.0
            "link:door": self._transport.name,
            "link:lost_frames": str(self._transport.lost),
        }

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier.

        Raises:
            LinkError: the bus is down, full or closed.
        """
        if not self._is_open:
            raise LinkError("The CAN bus is closed.", hint="Start again.")
        self._transport.send(can_id, data)
        if self._tap is not None:
            self._tap(((can_id, data, 0),))

    def receive(self) -> list[Frame]:
        """Return the device frames received, oldest first.

        Raises:
            LinkError: the bus is down.
        """
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        self._drain()
        frames, self._inbox = self._inbox, []
        return frames

    def has_unsent(self) -> bool:
        """Return whether frames wait in the send queue; False if it is not known."""
        return self._is_open and self._transport.has_unsent()

    def fileno(self) -> int:
        """Return the bus's descriptor, -1 if it has none."""
        return self._transport.fileno() if self._is_open else -1

    def is_readable(self) -> bool:
        """Return whether a device frame has arrived; False on a broken bus."""
        if not self._inbox:
            try:
                self._drain()
            except LinkError as error:
                self._error = error
                return False
        return bool(self._inbox)

    def close(self) -> None:
        """Release the bus; a second call does nothing."""
        if self._is_open:
            self._is_open = False
            self._transport.close()

    def _drain(self) -> None:
        if not self._is_open:
            return
        arrived = self._transport.receive()
        if arrived:
            self._sort(arrived)

    def _sort(self, arrived: list[Frame]) -> None:
        """Pass 11-bit data frames to the tap and keep those of devices."""
        if _DEVICE_IDS.issuperset(map(_can_id, arrived)):
            self._inbox += arrived
        else:
            self._inbox += [frame for frame in arrived if frame[0] in _DEVICE_IDS]
            self._note_others(arrived)
            arrived = [frame for frame in arrived if frame[0] <= _LARGEST_ID]
        if self._tap is not None and arrived:
            self._tap(arrived)

    def _note_others(self, arrived: list[Frame]) -> None:
        """Count the other frames: errors, mode broadcasts, other masters."""
        for frame in arrived:
            can_id = frame[0]
            if can_id > _LARGEST_ID:
                if can_id & ERROR_FLAG:
                    self.errors.add(can_id, frame[1])
            elif can_id == MODE_BROADCAST_ID:
                self.mode_hints += 1
            elif can_id not in _DEVICE_IDS:
                self.foreign_ids.add(can_id)
                if self.foreign_id is None:
                    self.foreign_id = can_id


def plausible_times(now_ns: int) -> tuple[int, int]:
    """Return the range of bus times (earliest, latest] of a frame read at `now_ns`.

    All times are monotonic [ns]; the earliest is excluded.
    """
    return now_ns - _PLAUSIBLE_NS, now_ns + _AHEAD_NS


def link_error(channel: str, error: Exception) -> LinkError:
    """Return the LinkError for a failed send or receive."""
    number = error_number(error)
    is_full = number in _FULL or (number is None and "full" in str(error).lower())
    if is_full:
        return LinkFullError(
            f"CAN {channel}: the send queue is full.",
            hint="No device acknowledges: is the arm powered, is the bus terminated?",
        )
    return LinkError(
        f"CAN {channel} failed: {error}.",
        hint="Check the adapter and its cable, then start again.",
    )


def error_number(error: Exception) -> int | None:
    """Return the errno of an exception of the system or of python-can."""
    python_can_errno = getattr(error, "error_code", None)
    return (
        python_can_errno
        if isinstance(python_can_errno, int)
        else getattr(error, "errno", None)
    )
