"""What the console asks of the arm while its loop does not run.

Each operation is written once, here. A backend in this thread calls it; a backend of
processes calls it through a proxy of this class (`acquisition.ipc.rpc`), so its
arguments and results are values that JSON can carry.
"""

from collections.abc import Callable, Sequence

import numpy as np

from acquisition.clock import PERIOD_NS, Clock
from acquisition.devices import SafetyMode
from wam.driver.arm import WamArm
from wam.driver.startup import ArmInfo

EXCHANGE_CYCLES = 100


class ArmOperations:
    """Acts on the arm of this process, whose bus is opened when it is first needed."""

    def __init__(
        self,
        opened: Callable[[], WamArm],
        clock: Clock,
        poll: Callable[[int], object] | None = None,
    ) -> None:
        """Open nothing yet.

        Args:
            opened: returns the arm, its bus open; raises LinkError.
            clock: the time of the loop.
            poll: called with the time [ns] between two exchanges, for what must not
                wait meanwhile.
        """
        self._opened = opened
        self._clock = clock
        self._poll = poll

    def start(self) -> ArmInfo:
        """Discover, wake and query the arm; raises as `WamArm.start`."""
        return self._opened().start()

    def measure_exchange(self) -> list[int]:
        """Ask 100 times for the positions, one period apart, without torque.

        Returns:
            From request to seventh position [ns]; incomplete exchanges are left out.
        """
        arm, clock = self._opened(), self._clock
        times: list[int] = []
        next_ns = clock.now_ns() + PERIOD_NS
        for _ in range(EXCHANGE_CYCLES):
            clock.sleep_until(next_ns)
            reading = arm.read(clock.now_ns())
            if reading.is_complete:
                times.append(reading.arm_ns - reading.host_ns)
            if self._poll is not None:
                self._poll(clock.now_ns())
            next_ns = max(next_ns + PERIOD_NS, clock.now_ns())
        return times

    def define_position(self, q: Sequence[float]) -> None:
        """Tell the arm that its joints stand at `q` [rad]; see `WamArm`."""
        self._opened().define_position(np.array(q))

    def idle(self) -> bool:
        """Idle the arm; return whether that is confirmed."""
        return self._opened().idle()

    def safety_mode(self) -> SafetyMode:
        """Return the mode that the safety module reported last."""
        return self._opened().safety_mode()
