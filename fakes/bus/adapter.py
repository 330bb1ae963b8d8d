"""Any other bus of python-can as the place where a network is served."""

import can

from acquisition import LinkError
from fakes.bus.hub import Frame
from wam.bus import open_bus

_DRAIN_AT_MOST = 512


class CanPort:
    """Carries frames between a bus of python-can and a network; never waits.

    Attributes:
        name: the bus as INTERFACE:CHANNEL.
        ignored: received frames that were no classic data frame.
        lost: frames that the bus did not take.
    """

    def __init__(self, interface: str, channel: str, bitrate: int) -> None:
        """Open the bus; raises LinkError if it cannot be."""
        self.name = f"{interface}:{channel}"
        self.ignored = 0
        self.lost = 0
        self._bus = open_bus(interface, channel, bitrate)
        self._inbox: list[Frame] = []
        self._is_open = True
        try:
            self._descriptor = self._bus.fileno()
        except NotImplementedError:
            self._descriptor = -1

    def fileno(self) -> int:
        """Return the bus's descriptor, -1 if it has none."""
        return self._descriptor

    def is_readable(self) -> bool:
        """Return whether a frame has arrived."""
        if not self._inbox:
            self._drain()
        return bool(self._inbox)

    def receive(self) -> list[Frame]:
        """Return the frames that have arrived.

        Raises:
            LinkError: the bus is down.
        """
        self._drain()
        frames, self._inbox = self._inbox, []
        return frames

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame of the network."""
        message = can.Message(arbitration_id=can_id, is_extended_id=False, data=data)
        try:
            self._bus.send(message)
        except (can.CanError, OSError):
            self.lost += 1  # as on a wire where nobody acknowledges

    def close(self) -> None:
        """Give the bus back; a second call does nothing."""
        if self._is_open:
            self._is_open = False
            self._bus.shutdown()

    def _drain(self) -> None:
        try:
            for _ in range(_DRAIN_AT_MOST):
                if (message := self._bus.recv(0)) is None:
                    return
                self._sort(message)
        except (can.CanError, OSError) as error:
            raise LinkError(
                f"CAN {self.name} broke: {error}.", hint="Check it, then serve again."
            ) from error

    def _sort(self, message: can.Message) -> None:
        is_other_kind = (
            message.is_extended_id or message.is_remote_frame or message.is_error_frame
        )
        if is_other_kind or message.is_fd:
            self.ignored += 1
        else:
            self._inbox.append((message.arbitration_id, bytes(message.data)))
