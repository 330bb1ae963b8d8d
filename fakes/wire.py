"""The wire between hosts and a puck network: one frame at a time, lowest id first."""

from heapq import heappop, heappush
from typing import NamedTuple

from fakes.pucks import PuckNetwork
from fakes.schedule import FRAME_NS, OutFrame
from wam.frames import Payload


class _Waiting(NamedTuple):
    """A frame that wants onto the wire; the lowest identifier goes first."""

    can_id: int
    order: int
    data: Payload
    is_of_host: bool


class WiredNetwork:
    """A `PuckNetwork` and the wire it hangs on; time is an argument.

    One frame is on the wire at a time; of those that wait, the lowest identifier wins.
    A frame counts as sent when its last bit is. Where hosts are other programs
    (`is_far`), the way to them and back takes about as long as a frame on the wire, so
    that a host's frame takes no time here, and a device's leaves with its first bit.
    """

    def __init__(self, network: PuckNetwork, *, is_far: bool = False) -> None:
        self.network = network
        self._is_far = is_far
        self._waiting: list[_Waiting] = []
        self._on_wire: tuple[int, _Waiting] | None = None
        self._free_ns = 0
        self._start_ns = 0
        self._order = 0
        self._sent: list[OutFrame] = []

    def send(self, t_ns: int, can_id: int, data: Payload) -> None:
        """Queue a host's frame at `t_ns`, the time of the last `advance`."""
        self._queue(t_ns, can_id, data, is_of_host=True)

    def drop_waiting(self) -> None:
        """Lose the frames that wait for the wire."""
        self._waiting.clear()

    def next_event_ns(self) -> int | None:
        """Return when wire or network do something next, None if never."""
        times = [self._next_wire_ns(), self.network.next_event_ns()]
        return min((t for t in times if t is not None), default=None)

    def advance(self, t_ns: int) -> list[OutFrame]:
        """Let wire and network go on to `t_ns`; return the devices' frames till then.

        Each comes with the time [ns] at which it was sent.
        """
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
                self._step(wire_ns)
            else:
                break
        self._take_due(t_ns)
        sent, self._sent = self._sent, []
        return sent

    def _take_due(self, t_ns: int) -> None:
        for ready_ns, can_id, data in self.network.due(t_ns):
            self._queue(ready_ns, can_id, data, is_of_host=False)

    def _queue(
        self, ready_ns: int, can_id: int, data: Payload, *, is_of_host: bool
    ) -> None:
        self._order += 1
        if not self._waiting:
            self._start_ns = max(self._free_ns, ready_ns)
        heappush(self._waiting, _Waiting(can_id, self._order, data, is_of_host))

    def _next_wire_ns(self) -> int | None:
        """Return when the frame on the wire ends, or the next one starts."""
        if self._on_wire is not None:
            return self._on_wire[0]
        return self._start_ns if self._waiting else None

    def _step(self, t_ns: int) -> None:
        if self._on_wire is None:
            self._start(t_ns, heappop(self._waiting))
            return
        self._free_ns, frame = self._on_wire
        self._on_wire = None
        self._start_ns = t_ns  # whoever waits by now has been ready for a while
        if frame.is_of_host:
            self.network.receive(t_ns, frame.can_id, frame.data)
        elif not self._is_far:
            self._sent.append((t_ns, frame.can_id, bytes(frame.data)))

    def _start(self, t_ns: int, frame: _Waiting) -> None:
        takes_ns = FRAME_NS[len(frame.data)]
        if self._is_far and frame.is_of_host:
            takes_ns = 0
        elif self._is_far:
            self._sent.append((t_ns, frame.can_id, bytes(frame.data)))
        self._on_wire = (t_ns + takes_ns, frame)
