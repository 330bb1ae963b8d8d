"""The seam between the console and the devices, in this process or in others."""

from collections.abc import Sequence
from typing import Protocol

from acquisition import PERIOD_NS, Clock, SafetyMode
from acquisition.control_loop import Grant
from acquisition.ipc import LoopClient
from acquisition.recording import TrialRecording
from wam.driver import ArmInfo, WamArm

EXCHANGE_CYCLES = 100


class RigBackend(Protocol):
    """Arm, sensor, loop and recorder as the console uses them.

    Attributes:
        loop_client: the console's side of the loop.
    """

    loop_client: LoopClient

    @property
    def recorder(self) -> TrialRecording:
        """What writes the trials."""
        ...

    @property
    def recorder_pid(self) -> int:
        """Number of the process that writes them."""
        ...

    def start_arm(self) -> ArmInfo:
        """Find, wake and question the arm; raises as `WamArm.start`.

        Where the bus is shared, another program's arm is refused first.
        """
        ...

    def measure_exchange(self) -> list[int]:
        """Ask 100 times for the positions, without torque.

        Returns:
            From request to seventh position [ns]; incomplete ones are left out.
        """
        ...

    def open_sensor(self) -> dict[str, str]:
        """Open the wrist sensor; return what it says about itself."""
        ...

    def sensor_metadata(self) -> dict[str, str]:
        """Return what became of the sensor's samples since it was opened, as text."""
        ...

    def define_position(self, q: Sequence[float]) -> None:
        """Tell the arm that its joints stand at `q` [rad]; see `WamArm`."""
        ...

    def begin(self) -> None:
        """Let the loop run from here on."""
        ...

    def grants(self) -> dict[str, list[Grant]]:
        """Return what the kernel granted to each process."""
        ...

    def idle(self) -> bool:
        """Brake the arm whatever has happened; return whether that is confirmed."""
        ...

    def safety_mode(self) -> SafetyMode:
        """Return what the safety module said last."""
        ...

    def close(self) -> None:
        """Brake the arm if it got torques, and end everything; safe to repeat."""
        ...


def measure_exchange(arm: WamArm, clock: Clock) -> list[int]:
    """Ask `arm` 100 times for its positions, one period apart, without torque.

    Returns:
        From request to seventh position [ns]; incomplete exchanges are left out.
    """
    times: list[int] = []
    next_ns = clock.now_ns() + PERIOD_NS
    for _ in range(EXCHANGE_CYCLES):
        clock.sleep_until(next_ns)
        reading = arm.read(clock.now_ns())
        if reading.is_complete:
            times.append(reading.arm_ns - reading.host_ns)
        next_ns = max(next_ns + PERIOD_NS, clock.now_ns())
    return times
