"""Pacing of stepped time to real time, so that a person can follow it."""

from acquisition.clock import Clock

_LATE_NS = 100_000_000  # largest lateness that is caught up
_WINDOW_NS = 2_000_000_000  # averaging time of the speed


class WallPace:
    """Limits simulated time to the speed of real time.

    On a slow computer the simulation stays late: it never catches up, since that would
    hurry a person who acts in it. Events depend on simulated time alone, so recordings
    are independent of real time.

    Args:
        world: simulated time.
        wall: real time.
    """

    def __init__(self, world: Clock, wall: Clock) -> None:
        self._world = world
        self._wall = wall
        self._origin_ns = wall.now_ns() - world.now_ns()
        self._since = (world.now_ns(), wall.now_ns())
        self._speed = 1.0

    @property
    def speed(self) -> float:
        """Recent speed of simulated time, as a share of real time."""
        return self._speed

    def keep(self) -> None:
        """Wait until real time has reached simulated time."""
        due_ns = self._world.now_ns() + self._origin_ns
        late_ns = self._wall.now_ns() - due_ns
        if late_ns < 0:
            self._wall.sleep_until(due_ns)
        elif late_ns > _LATE_NS:
            self._origin_ns += late_ns
        self._measure()

    def rest(self, seconds: float) -> None:
        """Wait `seconds` in real time while simulated time stands still."""
        wall_ns = round(seconds * 1e9)
        self._wall.sleep_until(self._wall.now_ns() + wall_ns)
        self._origin_ns += wall_ns
        self._since, self._speed = (self._world.now_ns(), self._wall.now_ns()), 1.0

    def _measure(self) -> None:
        world_ns, wall_ns = self._world.now_ns(), self._wall.now_ns()
        passed_ns = wall_ns - self._since[1]
        if passed_ns >= _WINDOW_NS:
            self._speed = (world_ns - self._since[0]) / passed_ns
            self._since = (world_ns, wall_ns)
