"""A CAN bus as the driver sees it: frames of devices, the rest sorted out."""

import errno
from collections.abc import Callable, Sequence
from functools import partial
from operator import itemgetter
from typing import NamedTuple, Protocol

from acquisition.clock import NS_PER_S
from acquisition.errors import LinkError, LinkFullError
from wam.bus.error_frames import ERROR_FLAG, BusErrors
from wam.bus.frames import MODE_BROADCAST_ID, is_of_host

_FULL = frozenset({errno.ENOBUFS, errno.EAGAIN})  # a queue, a socket's buffer
DRAIN_AT_MOST = 512  # frames; no flood may keep the loop here
_PLAUSIBLE_NS = 10 * NS_PER_S  # a stamp further back is of another clock
_AHEAD_NS = 5_000_000  # frames go on arriving while a bus is drained
_LARGEST_ID = 0x7FF  # of a frame that a WAM uses
_OF_DEVICES = frozenset(
    can_id
    for can_id in range(_LARGEST_ID + 1)
    if not is_of_host(can_id) and can_id != MODE_BROADCAST_ID
)
_can_id = itemgetter(0)  # of a frame


class Frame(NamedTuple):
    """A frame as received or sent.

    Attributes:
        can_id: 11-bit identifier; as a transport gives it also Linux's flags, of
            which an error, an extended or a remote frame has one.
        data: payload.
        t_ns: when the bus had it, on the host's monotonic clock [ns], 0 = not known.
    """

    can_id: int
    data: bytes
    t_ns: int


as_frame = partial(tuple[int | bytes].__new__, Frame)  # without the words of a call
Tap = Callable[[Sequence[tuple[int, bytes, int]]], None]  # each like a Frame


class Transport(Protocol):
    """Frames of all kinds, out and in; what a link needs of an adapter.

    Attributes:
        name: what it is, for people.
        lost: frames that arrived and found no room, as far as it can tell.
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
        """Return what has arrived, oldest first; never waits, raises LinkError."""
        ...

    def has_unsent(self) -> bool:
        """Return whether frames wait in this host, as far as it can tell."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""
        ...

    def close(self) -> None:
        """Give the adapter back."""
        ...


class Link(Protocol):
    """Frames out, frames in; what a driver needs of a bus."""

    @property
    def mode_hints(self) -> int:
        """Number of changes of mode that the safety module has announced."""
        ...

    @property
    def errors(self) -> BusErrors:
        """What error frames of the controller reported."""
        ...

    @property
    def foreign_id(self) -> int | None:
        """Identifier of the first frame of another master; None = none ever came."""
        ...

    def metadata(self) -> dict[str, str]:
        """Return which transport this is and what it lost, as text for a recording."""
        ...

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a frame; raises LinkError when the bus refuses it."""
        ...

    def receive(self) -> list[Frame]:
        """Return what has arrived, oldest first; never waits."""
        ...

    def has_unsent(self) -> bool:
        """Return whether frames wait in this host, as far as the transport can tell."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""
        ...

    def is_readable(self) -> bool:
        """Return whether `receive` would return something."""
        ...

    def close(self) -> None:
        """Give the bus back."""
        ...


class CanLink:
    """A bus seen by the driver: sent to, drained, never waited on.

    Frames of hosts (`is_of_host`, the own ones included), remote, extended and error
    frames are dropped. The safety module's broadcast of a change of mode has no known
    content: it is counted in `mode_hints` and dropped. A bus does not return what was
    sent through it, so a frame of a host that arrives is another master's.

    Attributes:
        mode_hints: broadcasts of the safety module so far.
        errors: what error frames of the controller reported.
        foreign_ids: identifiers of hosts' frames that have arrived so far.
        foreign_id: the first of them; None = none has.
    """

    def __init__(self, transport: Transport, tap: Tap | None = None) -> None:
        """Take over a transport.

        Args:
            transport: to the bus.
            tap: takes every data frame with an 11-bit identifier, sent or received;
                all that have arrived at once together.
        """
        self._tap = tap
        self.mode_hints = 0
        self.errors = BusErrors()
        self.foreign_ids: set[int] = set()
        self.foreign_id: int | None = None
        self._transport = transport
        self._inbox: list[Frame] = []
        self._error: LinkError | None = None  # looking came across it
        self._is_open = True

    def metadata(self) -> dict[str, str]:
        """Return which transport this is and what it lost, as text for a recording."""
        return {  # "door" is the word that recordings have had from the first
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
        """Return the device frames that have arrived, oldest first.

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
        """Return whether frames wait in this host, as far as the transport can tell."""
        return self._is_open and self._transport.has_unsent()

    def fileno(self) -> int:
        """Return the bus's descriptor, -1 if it has none."""
        return self._transport.fileno() if self._is_open else -1

    def is_readable(self) -> bool:
        """Return whether a device frame has arrived; a dead bus has none."""
        if not self._inbox:
            try:
                self._drain()
            except LinkError as error:
                self._error = error
                return False
        return bool(self._inbox)

    def close(self) -> None:
        """Give the bus back; a second call does nothing."""
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
        """Show plain frames to the tap and keep those of devices."""
        if _OF_DEVICES.issuperset(map(_can_id, arrived)):
            self._inbox += arrived
        else:
            self._inbox += [frame for frame in arrived if frame[0] in _OF_DEVICES]
            self._note_others(arrived)
            arrived = [frame for frame in arrived if frame[0] <= _LARGEST_ID]
        if self._tap is not None and arrived:
            self._tap(arrived)

    def _note_others(self, arrived: list[Frame]) -> None:
        """Note what is no frame of a device: errors, changes of mode, hosts."""
        for frame in arrived:
            can_id = frame[0]
            if can_id > _LARGEST_ID:
                if can_id & ERROR_FLAG:
                    self.errors.add(can_id, frame[1])
            elif can_id == MODE_BROADCAST_ID:
                self.mode_hints += 1
            elif can_id not in _OF_DEVICES:
                self.foreign_ids.add(can_id)
                if self.foreign_id is None:
                    self.foreign_id = can_id


def plausible_times(now_ns: int) -> tuple[int, int]:
    """Return between which times a frame that is at hand at `now_ns` was on the bus.

    The earliest, which is no such time any more, and the latest [monotonic ns].
    """
    return now_ns - _PLAUSIBLE_NS, now_ns + _AHEAD_NS


def broken_link(channel: str, error: Exception) -> LinkError:
    """Return what to raise when a bus refused to send or to receive."""
    number = error_number(error)
    is_full = number in _FULL or (number is None and "full" in str(error).lower())
    if is_full:
        return LinkFullError(
            f"CAN {channel}: the send queue is full.",
            hint="No device acknowledges: is the arm powered, is the bus terminated?",
        )
    return LinkError(
        f"CAN {channel} broke: {error}.",
        hint="Check the adapter and its cable, then start again.",
    )


def error_number(error: Exception) -> int | None:
    """Return the system's error number, which python-can keeps in its own field."""
    own = getattr(error, "error_code", None)
    return own if isinstance(own, int) else getattr(error, "errno", None)
