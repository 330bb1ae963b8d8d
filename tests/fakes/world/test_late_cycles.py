"""The simulated arm stays safe when every cycle of the loop is late."""

import numpy as np
import pytest

from acquisition.control_loop.faults import Fault
from acquisition.control_loop.loop import Loop
from acquisition.control_loop.states import ArmState
from tests.fakes.world.holding import SPEED, HoldBench
from tests.sweeps import swept

MS = 1_000_000
LIMIT_MS = 250.0  # of lasting lateness until the arm is idle
EACH_COMMIT = (1, 7, 13, 19, 33, 49)  # ms; the night has every second one


class LateClock:
    """Wakes the loop `late_ns` after each of its deadlines."""

    def __init__(self, clock):
        self.clock = clock
        self.late_ns = 0

    def now_ns(self):
        return self.clock.now_ns()

    def sleep_until(self, t_ns):
        self.clock.sleep_until(t_ns + self.late_ns)


def late_arm(state, friction, late_ms, twist=0.0, seconds=1.0):
    """Return (share of the speed limit, verdicts, idle after [ms]) of a late loop."""
    bench = HoldBench(friction=friction)
    clock = LateClock(bench.clock)
    bench.loop = Loop(bench.cycle, clock)
    bench.enter(state)
    bench.plant.disturbance[6] = twist
    bench.run(0.6)
    clock.late_ns = round(late_ms * MS)
    begin_ns, worst, idle_ms = bench.clock.now_ns(), 0.0, None
    while bench.clock.now_ns() < begin_ns + seconds * 1e9:
        bench.step()
        worst = max(worst, float((np.abs(bench.plant.qd) / SPEED).max()))
        if idle_ms is None and bench.cycle.status.state is ArmState.IDLE:
            idle_ms = (bench.clock.now_ns() - begin_ns) / MS
    faults = [verdict.fault for verdict in bench.cycle.status.active_verdicts]
    return worst, faults, idle_ms


@pytest.mark.parametrize("late_ms", swept([2.0, 6.6, 12.6, 18.6, 50.0], {2.0, 12.6}))
@pytest.mark.parametrize("state", [ArmState.FLOAT, ArmState.HOLD])
@pytest.mark.parametrize("friction", swept([0.02, 0.4], {0.02}))
def test_lasting_lateness_idles_the_arm_while_slow(friction, state, late_ms):
    worst, faults, idle_ms = late_arm(state, friction, late_ms)
    assert worst <= 1.0
    assert Fault.LOOP_LOST in faults
    assert idle_ms is not None
    assert idle_ms <= LIMIT_MS


@pytest.mark.slow
@pytest.mark.parametrize(
    "late_ms",
    [
        pytest.param(ms, marks=[] if ms in EACH_COMMIT else pytest.mark.long)
        for ms in range(1, 51, 2)
    ],
)
def test_no_lateness_makes_the_lock_of_joint_7_unstable(late_ms):
    for friction in (0.02, 0.4):
        for state in (ArmState.FLOAT, ArmState.HOLD, ArmState.GUIDE):
            assert late_arm(state, friction, late_ms, seconds=0.5)[0] <= 1.0


def test_a_twisted_foot_is_held_within_slow_loop_limits():
    worst, _, _ = late_arm(ArmState.FLOAT, 0.02, 6.6, twist=0.1)
    assert worst <= 0.5
