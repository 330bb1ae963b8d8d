"""A CAN bus in this process: a puck network behind python-can's own interface."""

import errno
from collections import deque
from typing import NoReturn

import can

from acquisition.clock import NS_PER_S, Clock
from fakes.pucks.event_queue import OutFrame
from fakes.pucks.network import PuckNetwork
from fakes.pucks.wire import WiredNetwork
from wam.bus.link import DRAIN_AT_MOST, as_frame
from wam.bus.link import Frame as TransportFrame
from wam.bus.transports import PythonCanTransport

_PATIENCE_NS = NS_PER_S
_QUEUE = 11  # frames: txqueuelen 10, and one in the driver


class FakeCanBus(can.BusABC):
    """A bus with one host and a `PuckNetwork`; time comes from the clock alone.

    Frames have the clock's monotonic time as their stamp [s]. An interface that is down
    (`network.faults.is_down`) refuses to send and to receive. What is sent through a
    controller that has left the bus (`is_off`) vanishes without a word, as in Linux.
    """

    def __init__(self, network: PuckNetwork, clock: Clock) -> None:
        self.channel_info = "fake bus"
        self.network = network
        self._faults, self._schedule = network.faults, network.schedule
        self._clock = clock
        self._inbox: deque[OutFrame] = deque()
        self._stuck: deque[can.Message] = deque()
        self._wired = WiredNetwork(network)
        self._t_ns = -1  # how far it has gone on
        super().__init__(channel="fake")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a frame for the wire at the clock's time; never waits.

        Raises:
            can.CanOperationError: the bus was shut down, or is off.
        """
        if self._is_shutdown:
            raise can.CanOperationError("the bus was shut down")
        faults = self._faults
        if faults.is_down:
            self._refuse()
        if faults.is_off:
            self._wired.drop_waiting()
            return
        if faults.is_unheard:
            if len(self._stuck) == _QUEUE:
                raise can.CanOperationError("No buffer space available", errno.ENOBUFS)
            self._stuck.append(msg)
            return
        now_ns = self._clock.now_ns()
        self.advance(now_ns)  # what was sent before takes the wire first
        if self._stuck:
            self._release(now_ns)
        if not (msg.is_extended_id or msg.is_remote_frame or msg.is_error_frame):
            self._wired.send(now_ns, msg.arbitration_id, bytes(msg.data))

    @property
    def is_undisturbed(self) -> bool:
        """Whether every plain frame comes and goes as it is."""
        faults = self._faults
        return not (
            faults.is_down
            or faults.is_off
            or faults.is_unheard
            or faults.error_frames
            or self._stuck
            or self._is_shutdown
            or self._filters is not None
        )

    def put(self, can_id: int, data: bytes) -> None:
        """Send a data frame as `send` does; only while `is_undisturbed`."""
        now_ns, schedule = self._clock.now_ns(), self._schedule
        if now_ns != self._t_ns or schedule.outbox or schedule.next_ns <= now_ns:
            self.advance(now_ns)
        self._wired.send(now_ns, can_id, data)

    def arrived(self) -> deque[OutFrame]:
        """Return what has arrived and waits to be taken, oldest first."""
        if not self._inbox and (now_ns := self._clock.now_ns()) != self._t_ns:
            self.advance(now_ns)
        return self._inbox

    def _release(self, now_ns: int) -> None:
        """Let the frames leave that waited while nobody acknowledged."""
        while self._stuck:
            old = self._stuck.popleft()
            self._wired.send(now_ns, old.arbitration_id, bytes(old.data))

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
        return self._wired.next_event_ns()

    def advance(self, t_ns: int) -> None:
        """Let wire and network go on to `t_ns`."""
        self._t_ns = t_ns
        self._inbox.extend(self._wired.advance(t_ns))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame, None when `timeout` [s] of the clock has passed.

        python-can would measure the time-out on the machine's own clock.

        Raises:
            can.CanOperationError: the bus is off.
        """
        faults = self._faults
        if faults.is_down:
            self._refuse()
        if faults.error_frames:
            classes, detail = faults.error_frames.pop(0)
            return can.Message(arbitration_id=classes, is_error_frame=True, data=detail)
        clock = self._clock
        if self._filters is None:  # the way that nearly every question takes
            # What is sent is on the wire for a while: at one instant nothing new comes.
            if self.arrived():
                return self._take()
            if timeout == 0:
                return None
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
        return (self._take() if is_ready else None), self._filters is None

    def _take(self) -> can.Message:
        t_ns, can_id, data = self._inbox.popleft()
        # positionally: stamp, identifier, is it an extended one
        return can.Message(t_ns / NS_PER_S, can_id, False, data=data)

    def _await(self, timeout: float | None) -> bool:
        patience_ns = _PATIENCE_NS if timeout is None else int(timeout * NS_PER_S)
        return self._clock.wait(_Inbox(self), self._clock.now_ns() + patience_ns)

    def _refuse(self) -> NoReturn:
        """Lose what waits, and say so as an interface does while it is down."""
        self._inbox.clear()
        self._wired.drop_waiting()
        raise can.CanOperationError("Network is down", errno.ENETDOWN)


class InProcessTransport(PythonCanTransport):
    """The transport of python-can for a `FakeCanBus`, without a message per frame.

    Only where nothing is out of the ordinary: a bus that is disturbed, and frames that
    have waited long, take python-can's way. What comes and goes is the same on both.
    """

    def __init__(self, bus: FakeCanBus, clock: Clock) -> None:
        """Take a bus over; times are of `clock`."""
        super().__init__(bus, clock)
        self._fake, self._now_ns = bus, clock.now_ns

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a data frame with an 11-bit identifier; raises LinkError."""
        if self._fake.is_undisturbed:
            self._fake.put(can_id, data)
        else:
            super().send(can_id, data)

    def receive(self) -> list[TransportFrame]:
        """Return what has arrived, oldest first; raises LinkError."""
        fake = self._fake
        if not fake.is_undisturbed or self._error is not None:
            return super().receive()
        inbox = fake.arrived()
        if not inbox:
            return []
        if len(inbox) >= DRAIN_AT_MOST or self._now_ns() - inbox[0][0] > NS_PER_S:
            return super().receive()
        frames = [as_frame((can_id, data, t_ns)) for t_ns, can_id, data in inbox]
        inbox.clear()
        return frames


class _Inbox:
    """What a clock waits for while a reader waits for a frame."""

    def __init__(self, bus: FakeCanBus) -> None:
        self._bus = bus

    def fileno(self) -> int:
        """Return -1: there is no descriptor."""
        return -1

    def is_readable(self) -> bool:
        """Return whether a frame has arrived."""
        return self._bus.is_readable()
