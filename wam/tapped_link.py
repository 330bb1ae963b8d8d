"""A link that remembers the frames that pass, for the flight record."""

from acquisition.clock import Clock
from acquisition.flight import FrameTape
from wam.can_link import Frame, Link


class TappedLink:
    """Implements wam.can_link.Link over another link and writes a tape."""

    def __init__(self, link: Link, tape: FrameTape, clock: Clock) -> None:
        self._link = link
        self._tape = tape
        self._clock = clock

    @property
    def mode_hints(self) -> int:
        """Mode broadcasts of the safety module so far."""
        return self._link.mode_hints

    def send(self, can_id: int, data: bytes) -> None:
        """Queue a frame; raises LinkError when the bus refuses it."""
        self._tape.add(self._clock.now_ns(), can_id, data)
        self._link.send(can_id, data)

    def receive(self) -> list[Frame]:
        """Return what has arrived, oldest first; never waits."""
        frames = self._link.receive()
        if frames:
            now = self._clock.now_ns()
            for frame in frames:
                self._tape.add(now, frame.can_id, bytes(frame.data))
        return frames

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""
        return self._link.fileno()

    def is_readable(self) -> bool:
        """Return whether `receive` would return something."""
        return self._link.is_readable()

    def close(self) -> None:
        """Give the bus back."""
        self._link.close()
