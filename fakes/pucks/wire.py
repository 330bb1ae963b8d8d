"""The wire between hosts and a puck network: one frame at a time, lowest id first."""

from heapq import heappop, heappush

from fakes.pucks.event_queue import FRAME_NS, NEVER, OutFrame
from fakes.pucks.network import PuckNetwork
from wam.bus.frames import Payload

# A frame waiting for the wire: identifier, order of arrival, data, is from a host.
# The lowest identifier goes first.
_Waiting = tuple[int, int, bytes, bool]


class WiredNetwork:
    """A `PuckNetwork` and its wire; time is an argument.

    One frame is on the wire at a time; of the waiting ones the lowest identifier wins.
    A frame counts as sent when its last bit is. Where hosts are other programs
    (`is_far`), the transport between them takes about as long as a frame on the wire,
    so a host's frame takes no time here and a device's is passed on at its first bit.
    """

    def __init__(self, network: PuckNetwork, *, is_far: bool = False) -> None:
        self.network = network
        self._schedule = network.schedule
        self._is_far = is_far
        self._waiting: list[_Waiting] = []
        self._on_wire: _Waiting | None = None
        self._free_ns = 0
        self._next_ns = NEVER  # end of the frame on the wire, or start of the next one
        self._order = 0
        self._sent: list[OutFrame] = []

    def send(self, t_ns: int, can_id: int, data: Payload) -> None:
        """Queue a host's frame at `t_ns`, the time of the last `advance`."""
        self._order = order = self._order + 1
        frame = (can_id, order, bytes(data), True)
        if self._waiting or self._on_wire is not None or self._free_ns > t_ns:
            self._claim_wire(t_ns)
            heappush(self._waiting, frame)
        else:  # the wire is free
            self._on_wire = frame
            self._next_ns = t_ns if self._is_far else t_ns + FRAME_NS[len(data)]

    def drop_waiting(self) -> None:
        """Discard the frames that wait for the wire."""
        self._waiting.clear()
        if self._on_wire is None:
            self._next_ns = NEVER

    def next_event_ns(self) -> int | None:
        """Return the time of the next event of wire or network [ns], None if never."""
        next_ns = min(self._next_ns, self._schedule.next_ns)
        return None if next_ns == NEVER else next_ns

    def advance(self, t_ns: int) -> list[OutFrame]:
        """Advance wire and network to `t_ns`; return the devices' frames sent so far.

        Each comes with the time [ns] at which it was sent.
        """
        schedule = self._schedule
        if schedule.next_ns > t_ns < self._next_ns and not schedule.outbox:
            schedule.now_ns = max(schedule.now_ns, t_ns)
            return []
        while True:
            if schedule.outbox:  # a device sent outside of all planned events
                self._queue_due(schedule.now_ns)
            # At one instant the network is first: its frame may win the arbitration.
            network_ns, wire_ns = schedule.next_ns, self._next_ns
            if network_ns <= t_ns and network_ns <= wire_ns:
                self._queue_due(network_ns)
            elif wire_ns <= t_ns:
                self._transmit(min(t_ns, network_ns - 1))
            else:
                break
        schedule.now_ns = max(schedule.now_ns, t_ns)  # nothing is planned until then
        sent, self._sent = self._sent, []
        return sent

    def _queue_due(self, t_ns: int) -> None:
        """Advance the network to `t_ns` and queue its frames for the wire."""
        due = self.network.due(t_ns)
        if not due:
            return
        self._claim_wire(due[0][0])
        waiting, order = self._waiting, self._order
        for _, can_id, data in due:
            order += 1
            heappush(waiting, (can_id, order, data, False))
        self._order = order

    def _claim_wire(self, ready_ns: int) -> None:
        """Plan the start of a frame ready at `ready_ns` if the wire has no other."""
        if not self._waiting and self._on_wire is None:
            self._next_ns = max(self._free_ns, ready_ns)

    def _transmit(self, until_ns: int) -> None:
        """Transmit frames until `until_ns`, or until one from a host arrived."""
        waiting, is_far, sent = self._waiting, self._is_far, self._sent
        t_ns, frame = self._next_ns, self._on_wire
        while t_ns <= until_ns:
            if frame is None:
                frame = heappop(waiting)
                if is_far:
                    t_ns = self._start(t_ns, frame)
                else:
                    t_ns += FRAME_NS[len(frame[2])]
                if t_ns > until_ns:  # it ends in a later call
                    break
            can_id, _, data, is_of_host = frame
            frame = None
            self._free_ns = t_ns
            if is_of_host:
                self._on_wire, self._next_ns = None, t_ns if waiting else NEVER
                self.network.receive(t_ns, can_id, data)
                return
            if not is_far:
                sent.append((t_ns, can_id, data))
            # Frames waiting now were ready before, so the next one starts at once.
            if not waiting:
                t_ns = NEVER
        self._on_wire, self._next_ns = frame, t_ns

    def _start(self, t_ns: int, frame: _Waiting) -> int:
        """Start a frame of far hosts at `t_ns`; return when it ends."""
        can_id, _, data, is_of_host = frame
        if is_of_host:
            return t_ns
        self._sent.append((t_ns, can_id, data))
        return t_ns + FRAME_NS[len(data)]
