"""Stepped time held back by the wall clock, so that a person can follow it."""

from acquisition.clock import Clock

_LATE_NS = 100_000_000  # a world that is later than this does not catch up
_WINDOW_NS = 2_000_000_000  # of the wall, over which the speed is told


class WallPace:
    """Lets simulated time pass no faster than time on the wall.

    Where the computer is too slow for that, the simulated world is late and stays so:
    it never hurries, for a person who acts in it would be hurried too. What happens in
    it depends on simulated time alone, so nothing that is recorded knows of the wall.

    Args:
        world: simulated time.
        wall: the time of whoever looks on.
    """

    def __init__(self, world: Clock, wall: Clock) -> None:
        self._world = world
        self._wall = wall
        self._origin_ns = wall.now_ns() - world.now_ns()
        self._since = (world.now_ns(), wall.now_ns())
        self._speed = 1.0

    @property
    def speed(self) -> float:
        """How fast simulated time passed lately, as a share of the wall's."""
        return self._speed

    def keep(self) -> None:
        """Wait until the wall has come as far as the world; go on at once if it has."""
        due_ns = self._world.now_ns() + self._origin_ns
        late_ns = self._wall.now_ns() - due_ns
        if late_ns < 0:
            self._wall.sleep_until(due_ns)
        elif late_ns > _LATE_NS:
            self._origin_ns += late_ns
        self._measure()

    def rest(self, seconds: float) -> None:
        """Let time pass on the wall while it stands in the world [s]."""
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
