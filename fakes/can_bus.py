"""A CAN bus in this process: a puck network behind python-can's own interface."""

from collections import deque
from heapq import heappop, heappush

import can

from acquisition.clock import NS_PER_S, Clock
from fakes.pucks import PuckNetwork
from wam.frames import Payload

# One bit is 1 us at 1 Mbit/s: 47 bits of frame and 8 per byte, with the stuff bits
# that typical content needs.
FRAME_NS = tuple(1000 * bits for bits in (50, 58, 67, 76, 84, 93, 101, 110, 118))
_PATIENCE_NS = NS_PER_S

Waiting = tuple[int, int, Payload, bool]  # identifier, order, data, is of the host


class FakeCanBus(can.BusABC):
    """A bus with one host and a `PuckNetwork`; time comes from the clock alone.

    One frame is on the wire at a time; of those that wait, the lowest identifier wins.
    Frames have the clock's monotonic time as their stamp [s].
    """

    def __init__(self, network: PuckNetwork, clock: Clock) -> None:
        self.channel_info = "fake bus"
        self.network = network
        self._clock = clock
        self._inbox: deque[can.Message] = deque()
        self._waiting: list[Waiting] = []
        self._on_wire: tuple[int, Waiting] | None = None
        self._free_ns = 0
        self._start_ns = 0
        self._order = 0
        super().__init__(channel="fake")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a frame for the wire at the clock's time; never waits.

        Raises:
            can.CanOperationError: the bus was shut down.
        """
        if self._is_shutdown:
            raise can.CanOperationError("the bus was shut down")
        now_ns = self._clock.now_ns()
        self.advance(now_ns)
        if not (msg.is_extended_id or msg.is_remote_frame or msg.is_error_frame):
            self._queue(now_ns, msg.arbitration_id, bytes(msg.data), is_of_host=True)

    def fileno(self) -> int:
        """There is no descriptor to wait on."""
        raise NotImplementedError("a bus inside the process has no descriptor")

    def is_readable(self) -> bool:
        """Return whether a frame has arrived by the clock's time."""
        if not self._inbox:
            self.advance(self._clock.now_ns())
        return bool(self._inbox)

    def next_event_ns(self) -> int | None:
        """Return when wire or network do something next, None if never."""
        times = [self._next_wire_ns(), self.network.next_event_ns()]
        return min((t for t in times if t is not None), default=None)

    def advance(self, t_ns: int) -> None:
        """Let wire and network go on to `t_ns`."""
        while True:
            wire_ns = self._next_wire_ns()
            own_ns = self.network.next_event_ns()
            # At one instant the network is first: its frame may win the arbitration.
            if (
                own_ns is not None
                and own_ns <= t_ns
                and not (wire_ns is not None and wire_ns < own_ns)
            ):
                self._take_due(own_ns)
            elif wire_ns is not None and wire_ns <= t_ns:
                self._step_wire(wire_ns)
            else:
                break
        self._take_due(t_ns)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame, None when `timeout` [s] of the clock has passed.

        python-can would measure the time-out on the machine's own clock.
        """
        clock = self._clock
        patience_ns = 0 if timeout is None else int(timeout * NS_PER_S)
        deadline_ns = clock.now_ns() + patience_ns if timeout else 0
        while True:
            left = (deadline_ns - clock.now_ns()) / NS_PER_S if timeout else timeout
            message, is_filtered = self._recv_internal(left)
            if message is None:
                if timeout is not None:
                    return None
            elif is_filtered or self._matches_filters(message):
                return message

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        is_ready = self.is_readable()
        can_wait = timeout is None or timeout > 0
        if not is_ready and can_wait and not self._is_shutdown:
            is_ready = self._await(timeout)
        return (self._inbox.popleft() if is_ready else None), self._filters is None

    def _await(self, timeout: float | None) -> bool:
        patience_ns = _PATIENCE_NS if timeout is None else int(timeout * NS_PER_S)
        return self._clock.wait(_Inbox(self), self._clock.now_ns() + patience_ns)

    def _take_due(self, t_ns: int) -> None:
        for ready_ns, can_id, data in self.network.due(t_ns):
            self._queue(ready_ns, can_id, data, is_of_host=False)

    def _queue(
        self, ready_ns: int, can_id: int, data: Payload, *, is_of_host: bool
    ) -> None:
        self._order += 1
        if not self._waiting:
            self._start_ns = max(self._free_ns, ready_ns)
        heappush(self._waiting, (can_id, self._order, data, is_of_host))

    def _next_wire_ns(self) -> int | None:
        """Return when the frame on the wire ends, or the next one starts."""
        if self._on_wire is not None:
            return self._on_wire[0]
        return self._start_ns if self._waiting else None

    def _step_wire(self, t_ns: int) -> None:
        if self._on_wire is None:
            winner = heappop(self._waiting)
            self._on_wire = (t_ns + FRAME_NS[len(winner[2])], winner)
            return
        self._free_ns, (can_id, _, data, is_of_host) = self._on_wire
        self._on_wire = None
        self._start_ns = t_ns  # whoever waits by now has been ready for a while
        if is_of_host:
            self.network.receive(t_ns, can_id, data)
            return
        self._inbox.append(
            can.Message(
                timestamp=t_ns / NS_PER_S,
                arbitration_id=can_id,
                is_extended_id=False,
                data=data,
            )
        )


class _Inbox:
    """What a clock waits for while somebody waits for a frame."""

    def __init__(self, bus: FakeCanBus) -> None:
        self._bus = bus

    def fileno(self) -> int:
        """Return -1: there is no descriptor."""
        return -1

    def is_readable(self) -> bool:
        """Return whether a frame has arrived."""
        return self._bus.is_readable()
