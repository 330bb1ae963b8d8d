"""What the processes of a rig offer to the console, each as a Protocol."""

from typing import Protocol

from acquisition.control_loop.realtime import Grant


class ControlService(Protocol):
    """The process that drives the arm, beside its `ArmOperations`.

    It answers while its loop is not running.
    """

    def claim(self) -> None:
        """Open the bus and refuse an arm that is another program's; see `claim`."""
        ...

    def open_sensor(self) -> dict[str, str]:
        """Open a wrist sensor on the arm's bus; return its description."""
        ...

    def begin(self) -> None:
        """Run the loop from here on."""
        ...

    def grants(self) -> list[Grant]:
        """Return what the kernel granted."""
        ...


class SensorService(Protocol):
    """The process that reads a serial wrist sensor."""

    def open_sensor(self) -> dict[str, str]:
        """Open the sensor; return its description."""
        ...

    def sensor_metadata(self) -> dict[str, str]:
        """Return the statistics of the stream since it was opened, as text."""
        ...

    def grants(self) -> list[Grant]:
        """Return what the kernel granted."""
        ...
