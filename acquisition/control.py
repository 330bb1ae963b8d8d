"""The console's side of the loop: let it run, ask for states, look at the newest."""

from acquisition.cycle import ArmState, ControlStatus, Cycle
from acquisition.loop import PERIOD_NS, Loop
from acquisition.recorder import Recorder
from acquisition.sample import Record
from acquisition.shared import SampleRing

NS_PER_S = 1_000_000_000


class InlineControl:
    """Loop, cycle and recorder in this thread: nothing runs unless `advance` does."""

    def __init__(
        self, loop: Loop, cycle: Cycle, recorder: Recorder, ring: SampleRing
    ) -> None:
        self._loop = loop
        self._cycle = cycle
        self.recorder = recorder
        self._ring = ring

    @property
    def status(self) -> ControlStatus:
        """State of the arm and the guard's last verdict."""
        return self._cycle.status

    @property
    def late_cycles(self) -> int:
        """Cycles that began late since the start."""
        return self._loop.stats.late

    def advance(self, seconds: float) -> None:
        """Run the loop for `seconds`, then drain the recorder."""
        self._loop.run(max(1, round(seconds * NS_PER_S / PERIOD_NS)))
        self.recorder.drain()

    def pause(self) -> None:
        """Forget the time grid: the loop will not run for a while, on purpose."""
        self._loop.restart_grid()

    def request(self, state: ArmState) -> None:
        """Ask the loop for a state of the arm."""
        self._cycle.request(state)

    def watch_trial(self, *, is_recording: bool) -> None:
        """Switch the guard's limits for a running trial on or off."""
        self._cycle.is_recording = is_recording

    def last(self, seconds: float) -> Record:
        """Return the records of the last `seconds`, oldest first."""
        count = round(seconds * NS_PER_S / PERIOD_NS)
        return self._ring.since(max(0, self._ring.written - count))[0]

    def latest(self) -> Record:
        """Return the newest record, shape (1,); empty before the first cycle."""
        return self._ring.latest()
