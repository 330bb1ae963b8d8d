"""A wrist sensor that another process reads, as the loop sees it."""

from acquisition.devices import WrenchSample
from acquisition.ipc.layout import pack_wrench, unpack_wrenches
from acquisition.ipc.ring_buffer import Ring


class SharedSensor:
    """Takes samples from the board; implements `acquisition.devices.WrenchSensor`."""

    def __init__(self, ring: Ring) -> None:
        self._reader = ring.reader()

    def open(self) -> None:
        """Do nothing: the process that has the port has opened it."""

    def poll(self, now_ns: int) -> list[WrenchSample]:
        """Return every sample since the last call, oldest first."""
        del now_ns
        if not self._reader.backlog:
            return []
        return unpack_wrenches(self._reader.read())

    def describe(self) -> dict[str, str]:
        """Return nothing: the process that has the port knows."""
        return {}

    def stream_metadata(self) -> dict[str, str]:
        """Return nothing: the process that has the port knows."""
        return {}

    def close(self) -> None:
        """Do nothing: the process that has the port closes it."""


def publish(samples: list[WrenchSample], ring: Ring) -> None:
    """Write samples into the board's ring, oldest first."""
    for sample in samples:
        ring.write(pack_wrench(sample))
