from fakes.clock import EPOCH_UTC_NS, START_NS, SteppedClock


class World:
    """A world with events at fixed times that records the times it advances to."""

    def __init__(self, clock, *events):
        self.clock = clock
        self.events = list(events)
        self.advanced = []

    def advance(self, t_ns):
        self.advanced.append(t_ns)

    def next_event_ns(self):
        later = [t for t in self.events if t > self.clock.now_ns()]
        return min(later, default=None)

    def fileno(self):
        return -1

    def is_readable(self):
        return any(t <= self.clock.now_ns() for t in self.events)


def test_start_and_epoch_are_fixed():
    clock = SteppedClock()
    assert (clock.now_ns(), clock.utc_ns()) == (START_NS, EPOCH_UTC_NS)
    clock.sleep_until(START_NS + 5)
    assert (clock.now_ns(), clock.utc_ns()) == (START_NS + 5, EPOCH_UTC_NS + 5)


def test_sleeping_advances_the_world_monotonically():
    clock = SteppedClock()
    world = World(clock)
    clock.attach(world)
    clock.sleep_until(START_NS + 10)
    clock.sleep_until(START_NS + 3)
    assert clock.now_ns() == START_NS + 10
    assert world.advanced == [START_NS + 10]


def test_waiting_ends_at_the_first_event():
    clock = SteppedClock()
    world = World(clock, START_NS + 7, START_NS + 9)
    clock.attach(world)
    assert clock.wait(world, START_NS + 20)
    assert clock.now_ns() == START_NS + 7


def test_waiting_for_nothing_ends_at_the_deadline():
    clock = SteppedClock()
    world = World(clock, START_NS + 30)
    clock.attach(world)
    assert not clock.wait(world, START_NS + 20)
    assert clock.now_ns() == START_NS + 20


def test_waiting_for_a_present_event_takes_no_time():
    clock = SteppedClock()
    world = World(clock, START_NS)
    clock.attach(world)
    assert clock.wait(world, START_NS + 20)
    assert clock.now_ns() == START_NS


def test_a_clock_without_a_world_still_runs():
    clock = SteppedClock()
    assert not clock.wait(World(clock), START_NS + 4)
    assert clock.now_ns() == START_NS + 4
