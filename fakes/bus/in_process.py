"""CAN bus in this process: a simulated puck network behind python-can's interface."""

import errno
from collections import deque
from typing import NoReturn

import can

from acquisition.clock import NS_PER_S, Clock
from fakes.pucks.event_queue import OutFrame
from fakes.pucks.network import PuckNetwork
from fakes.pucks.wire import WiredNetwork
from wam.bus.link import MAX_DRAINED_FRAMES, as_frame
from wam.bus.link import Frame as TransportFrame
from wam.bus.transports import PythonCanTransport

_PATIENCE_NS = NS_PER_S
_QUEUE = 11  # frames: txqueuelen 10 plus one in the driver


class FakeCanBus(can.BusABC):
    """A bus with one host and a `PuckNetwork`; all time is from the given clock.

    Frames are stamped with the clock's monotonic time [s]. An interface that is down
    (`network.faults.is_down`) refuses to send and to receive. With a controller in
    bus-off (`is_off`), sent frames are dropped silently, as in Linux.
    """

    def __init__(self, network: PuckNetwork, clock: Clock) -> None:
        self.channel_info = "fake bus"
        self.network = network
        self._faults, self._schedule = network.faults, network.schedule
        self._clock = clock
        self._inbox: deque[OutFrame] = deque()
        self._stuck: deque[can.Message] = deque()
        self._wired = WiredNetwork(network)
        self._t_ns = -1  # time of the last advance
        super().__init__(channel="fake")

    def __del__(self) -> None:
        """Do nothing: a bus that was never opened by a driver has nothing to release.

        python-can would print a warning among the program's own messages.
        """

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a frame for the wire at the clock's time without blocking.

        Raises:
            can.CanOperationError: the bus was shut down or is down, or its queue is
                full.
        """
        if self._is_shutdown:
            raise can.CanOperationError("the bus was shut down")
        faults = self._faults
        if faults.is_down:
            self._refuse()
        if faults.is_off:
            self._wired.drop_waiting()
            return
        if faults.is_unacknowledged:
            if len(self._stuck) == _QUEUE:
                raise can.CanOperationError("No buffer space available", errno.ENOBUFS)
            self._stuck.append(msg)
            return
        now_ns = self._clock.now_ns()
        self.advance(now_ns)  # earlier frames occupy the wire first
        if self._stuck:
            self._release(now_ns)
        if not (msg.is_extended_id or msg.is_remote_frame or msg.is_error_frame):
            self._wired.send(now_ns, msg.arbitration_id, bytes(msg.data))

    @property
    def is_undisturbed(self) -> bool:
        """Whether no fault, filter or shutdown affects data frames."""
        faults = self._faults
        return not (
            faults.is_down
            or faults.is_off
            or faults.is_unacknowledged
            or faults.error_frames
            or self._stuck
            or self._is_shutdown
            or self._filters is not None
        )

    def put(self, can_id: int, data: bytes) -> None:
        """Send a data frame like `send`; only while `is_undisturbed`."""
        now_ns, schedule = self._clock.now_ns(), self._schedule
        if now_ns != self._t_ns or schedule.outbox or schedule.next_ns <= now_ns:
            self.advance(now_ns)
        self._wired.send(now_ns, can_id, data)

    def arrived(self) -> deque[OutFrame]:
        """Return the inbox of received frames, oldest first."""
        if not self._inbox and (now_ns := self._clock.now_ns()) != self._t_ns:
            self.advance(now_ns)
        return self._inbox

    def _release(self, now_ns: int) -> None:
        """Send the frames that waited for an acknowledgement."""
        while self._stuck:
            old = self._stuck.popleft()
            self._wired.send(now_ns, old.arbitration_id, bytes(old.data))

    def fileno(self) -> int:
        """Raise: there is no descriptor."""
        raise NotImplementedError("a bus inside the process has no descriptor")

    def is_readable(self) -> bool:
        """Return whether a frame has arrived by the clock's time."""
        if not self._inbox:
            self.advance(self._clock.now_ns())
        return bool(self._inbox)

    def next_event_ns(self) -> int | None:
        """Return the time of the next event of wire or network, or None."""
        return self._wired.next_event_ns()

    def advance(self, t_ns: int) -> None:
        """Advance wire and network to `t_ns`."""
        self._t_ns = t_ns
        self._inbox.extend(self._wired.advance(t_ns))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame, None after `timeout` [s] of the simulated clock.

        Overridden, because python-can measures time-outs by the machine's clock.

        Raises:
            can.CanOperationError: the interface is down.
        """
        faults = self._faults
        if faults.is_down:
            self._refuse()
        if faults.error_frames:
            classes, detail = faults.error_frames.pop(0)
            return can.Message(arbitration_id=classes, is_error_frame=True, data=detail)
        clock = self._clock
        if self._filters is None:  # the usual, fast path
            # Frames take time on the wire: none arrives at the time of sending.
            if self.arrived():
                return self._take()
            if timeout == 0:
                return None
        patience_ns = 0 if timeout is None else int(timeout * NS_PER_S)
        deadline_ns = clock.now_ns() + patience_ns if timeout else 0
        while True:
            remaining = (
                (deadline_ns - clock.now_ns()) / NS_PER_S if timeout else timeout
            )
            message, is_filtered = self._recv_internal(remaining)
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
        return (self._take() if is_ready else None), self._filters is None

    def _take(self) -> can.Message:
        t_ns, can_id, data = self._inbox.popleft()
        # timestamp, identifier, is_extended_id; positional arguments are faster
        return can.Message(t_ns / NS_PER_S, can_id, False, data=data)

    def _await(self, timeout: float | None) -> bool:
        patience_ns = _PATIENCE_NS if timeout is None else int(timeout * NS_PER_S)
        return self._clock.wait(_Inbox(self), self._clock.now_ns() + patience_ns)

    def _refuse(self) -> NoReturn:
        """Drop waiting frames and raise the error of an interface that is down."""
        self._inbox.clear()
        self._wired.drop_waiting()
        raise can.CanOperationError("Network is down", errno.ENETDOWN)


class InProcessTransport(PythonCanTransport):
    """Transport for a `FakeCanBus` that bypasses python-can's messages, for speed.

    On a disturbed bus, and for frames that have waited long, it falls back to
    python-can. Both paths give the same frames.
    """

    def __init__(self, bus: FakeCanBus, clock: Clock) -> None:
        """Take ownership of a bus; frame times are by `clock`."""
        super().__init__(bus, clock)
        self._fake, self._now_ns = bus, clock.now_ns

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier; raises LinkError."""
        if self._fake.is_undisturbed:
            self._fake.put(can_id, data)
        else:
            super().send(can_id, data)

    def receive(self) -> list[TransportFrame]:
        """Return the queued frames, oldest first; raises LinkError."""
        fake = self._fake
        if not fake.is_undisturbed or self._error is not None:
            return super().receive()
        inbox = fake.arrived()
        if not inbox:
            return []
        if len(inbox) >= MAX_DRAINED_FRAMES or self._now_ns() - inbox[0][0] > NS_PER_S:
            return super().receive()
        frames = [as_frame((can_id, data, t_ns)) for t_ns, can_id, data in inbox]
        inbox.clear()
        return frames


class _Inbox:
    """Readable for the clock to wait on, without python-can's filters."""

    def __init__(self, bus: FakeCanBus) -> None:
        self._bus = bus

    def fileno(self) -> int:
        """Return -1: there is no descriptor."""
        return -1

    def is_readable(self) -> bool:
        """Return whether a frame has arrived."""
        return self._bus.is_readable()
