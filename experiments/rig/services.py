"""What the processes of a rig offer to the console, each as a Protocol."""

from collections.abc import Sequence
from typing import Protocol

from acquisition.control_loop.realtime import Grant
from acquisition.devices import SafetyMode
from wam.driver.startup import ArmInfo


class ArmService(Protocol):
    """The process that drives the arm; it answers while its loop is not running."""

    def claim(self) -> None:
        """Open the bus and refuse an arm that is another program's; see `claim`."""
        ...

    def start_arm(self) -> ArmInfo:
        """Discover, wake and query the arm; raises as `WamArm.start`."""
        ...

    def measure_exchange(self) -> list[int]:
        """Return how long 100 exchanges took [ns], see `measure_exchange`."""
        ...

    def open_sensor(self) -> dict[str, str]:
        """Open a wrist sensor on the arm's bus; return its description."""
        ...

    def define_position(self, q: Sequence[float]) -> None:
        """Set the joint positions to `q` [rad]; see `WamArm`."""
        ...

    def begin(self) -> None:
        """Run the loop from here on."""
        ...

    def idle(self) -> bool:
        """Brake the arm; return whether that is confirmed."""
        ...

    def safety_mode(self) -> SafetyMode:
        """Return the mode that the safety module reported last."""
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
