"""The short way of a usual cycle beside the long one: the same to the nanosecond.

Two networks are told the same by a host and by the world; one of them has the wire with
the short way. All frames, torques, brakes and displays have to agree, whatever comes
between the cycles and wherever in a cycle it comes.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from acquisition.clock import PERIOD_NS
from acquisition.devices import SafetyMode
from fakes.kernels.choice import COMPILED, chosen_dynamics
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from fakes.pucks.wire import WiredNetwork, lay_wire
from wam.bus.frames import (
    Group,
    encode_get,
    encode_set,
    encode_torques,
    group_id,
    position_reply_id,
)

if chosen_dynamics() != COMPILED:
    pytest.skip("nothing is compiled here", allow_module_level=True)
from fakes.pucks.compiled import CyclicWire

MS = 1_000_000
P = 48
ARM, LOWER, WRIST = (
    group_id(group) for group in (Group.ARM, Group.LOWER_TORQUE, Group.WRIST_TORQUE)
)
ACTIVE = NetworkOptions(safety_mode=SafetyMode.ACTIVE)
MADE_OTHERWISE = replace(ACTIVE, vers=(100,) * 7, cts=(40960,) * 7, latch_ns=120_000)


class Swaying:
    """Motors that sway whatever they are told, and note what they are told."""

    def __init__(self):
        self.t_ns, self.speed, self.told = 0, 1.0, []

    def advance(self, t_ns):
        assert t_ns >= self.t_ns
        self.t_ns = t_ns

    def counts(self):
        phase = 2.0 * math.pi * self.t_ns * 1e-9
        sway = 100.0 * self.speed * math.sin(phase)
        return [math.floor((i - 3) * 400_000 + (i + 1) * sway) for i in range(7)]

    def set_torques(self, units):
        self.told.append((self.t_ns, [int(unit) for unit in units]))

    def set_braking(self, is_braked, is_powered):
        self.told.append((self.t_ns, is_braked, is_powered))


class Arm:
    """A network on a wire."""

    def __init__(self, options, *, is_short):
        self.motors = Swaying()
        self.network = PuckNetwork(self.motors, options)
        self.wire = lay_wire(self.network, is_compiled=is_short)

    def state(self, t_ns):
        """Go on to `t_ns`; return all that can be seen from outside."""
        frames = [
            (at, can_id, bytes(data)) for at, can_id, data in self.wire.advance(t_ns)
        ]
        told, self.motors.told = self.motors.told, []
        safety = self.network.parts.safety  # a look that is no touch
        shown = safety.mode, safety.pendant_word
        times = self.wire.next_event_ns(), self.network.schedule.now_ns
        return frames, told, shown, times


def units(rng, most):
    return [int(unit) for unit in rng.integers(-most, most + 1, 4)]


# What may come between two moments of a cycle, from the host or the world.
EVENTS = {
    "question for a property": lambda a, t, rng: a.wire.send(
        t, int(rng.integers(1, 8)), encode_get(int(rng.integers(0, 100)))
    ),
    "question for the torque": lambda a, t, rng: a.wire.send(t, 3, encode_get(42)),
    "question to the safety module": lambda a, t, rng: a.wire.send(
        t, 10, encode_get(int(rng.choice([0, 5, 8, 42, 43])))
    ),
    "second question for positions": lambda a, t, rng: a.wire.send(
        t, ARM, encode_get(P)
    ),
    "question to the arm for another": lambda a, t, rng: a.wire.send(
        t, ARM, encode_get(8)
    ),
    "large torques": lambda a, t, rng: a.wire.send(
        t, LOWER, encode_torques(units(rng, 8000))
    ),
    "short torque frame": lambda a, t, rng: a.wire.send(
        t, WRIST, encode_torques([1, 2, 3, 4])[:6]
    ),
    "torques of another firmware": lambda a, t, rng: a.wire.send(
        t, LOWER, encode_torques([10, 20, 30, 40], 41)
    ),
    "less torque allowed": lambda a, t, rng: a.wire.send(
        t, int(rng.integers(1, 8)), encode_set(43, int(rng.integers(0, 900)))
    ),
    "another place in the frame": lambda a, t, rng: a.network.set_property(
        2, "PIDX", int(rng.integers(1, 5))
    ),
    "another group": lambda a, t, rng: a.network.set_property(
        int(rng.integers(1, 8)), "GRPB", int(rng.integers(1, 3))
    ),
    "own position set": lambda a, t, rng: a.wire.send(
        t,
        int(rng.integers(1, 8)),
        encode_set(P, int(rng.integers(-9999, 9999))),
    ),
    "button": lambda a, t, rng: a.network.pendant(
        ("activate", "activate", "activate", "idle", "estop")[rng.integers(5)]
    ),
    "limit of torque": lambda a, t, rng: a.wire.send(
        t, 10, encode_set(int(rng.choice([46, 47])), int(rng.integers(1, 4000)))
    ),
    "faster": lambda a, t, rng: setattr(a.motors, "speed", float(rng.integers(1, 300))),
    "slow again": lambda a, t, rng: setattr(a.motors, "speed", 1.0),
    "strained": lambda a, t, rng: a.network.trip(
        ("velocity", "torque", "heartbeat")[rng.integers(3)]
    ),
    "relaxed": lambda a, t, rng: a.network.reset_monitors(),
    "mute": lambda a, t, rng: a.network.silence(int(rng.choice([1, 5, 10]))),
    "heard again": lambda a, t, rng: [
        a.network.silence(node, is_mute=False) for node in (1, 5, 10)
    ],
    "another master": lambda a, t, rng: a.network.other_master.join(),
    "alone again": lambda a, t, rng: a.network.other_master.leave(),
    "voltage": lambda a, t, rng: a.network.set_bus_voltage(float(rng.choice([30, 48]))),
    "rebooted": lambda a, t, rng: a.network.reboot(int(rng.integers(1, 8))),
    "wake": lambda a, t, rng: [
        a.wire.send(t, node, encode_set(5, 2)) for node in range(1, 8)
    ],
    "a plan": lambda a, t, rng: a.network.schedule.after(
        int(rng.integers(0, MS)), lambda: a.network.pendant("idle")
    ),
    "heartbeat": lambda a, t, rng: a.network.set_heartbeat(
        int(rng.choice([1, 50, 100])) * MS
    ),
    "forgotten": lambda a, t, rng: a.network.forget_positions(),
    "lost": lambda a, t, rng: a.network.faults.drop(
        position_reply_id(int(rng.integers(1, 8)))
    ),
    "late": lambda a, t, rng: a.network.faults.delay(position_reply_id(2), 300_000),
    "interface down": lambda a, t, rng: a.wire.drop_waiting(),
}
BUS_FAULTS = {"lost", "late"}  # frames go the long way for ever after them


def cycle(t_ns, rng, most):
    """Return what a host does in a cycle: (time, identifier, data), None = look."""
    steps = [(t_ns, ARM, encode_get(P))]
    look_ns = t_ns + int(rng.choice([900_000, 850_000, 300_000, 600_000]))
    steps.append((look_ns, None, b""))
    # Once in a while the host is late, and asks again before all has left the wire.
    say_ns = look_ns + int(rng.choice([0, 150_000, 950_000], p=[0.8, 0.1, 0.1]))
    steps += [
        (say_ns, can_id, encode_torques(units(rng, most))) for can_id in (LOWER, WRIST)
    ]
    return steps


def drive(options, seed, *, cycles, events, share):
    """Tell two networks the same; compare them at every step, return what came."""
    rng = np.random.default_rng(seed)
    arms = [Arm(options, is_short=is_short) for is_short in (False, True)]
    frames, torques = 0, 0
    for k in range(cycles):
        for t_ns, can_id, data in cycle(k * PERIOD_NS, rng, 1500):
            seen = [arm.state(t_ns) for arm in arms]
            assert seen[1] == seen[0], (k, t_ns)
            frames += len(seen[0][0])
            torques += len(seen[0][1])
            if rng.random() < share:
                name = events[rng.integers(len(events))]
                choice = int(rng.integers(2**30))
                for arm in arms:
                    EVENTS[name](arm, t_ns, np.random.default_rng(choice))
            if can_id is not None:
                for arm in arms:
                    arm.wire.send(t_ns, can_id, data)
    return frames, torques, arms[1].wire.shortened / cycles


def test_the_wires_differ_in_kind():
    short, long = (Arm(ACTIVE, is_short=is_short).wire for is_short in (True, False))
    assert isinstance(short, CyclicWire)
    assert type(long) is WiredNetwork


@pytest.mark.parametrize("options", [ACTIVE, MADE_OTHERWISE], ids=["usual", "other"])
def test_an_arm_at_work_takes_the_short_way(options):
    frames, torques, short = drive(options, 1, cycles=400, events=(), share=0.0)
    assert frames > 2700
    assert torques >= 798
    assert short > 0.8


def test_pucks_in_other_groups_take_the_long_way():
    arm = Arm(ACTIVE, is_short=True)
    arm.network.set_property(2, "GRPB", 2)
    arm.wire.send(0, ARM, encode_get(P))
    assert len(arm.wire.advance(900_000)) == 7
    assert arm.wire.shortened == 0


def test_a_fault_on_the_bus_ends_the_short_way_for_good():
    arm = Arm(ACTIVE, is_short=True)
    for k in range(4):
        arm.wire.send(k * PERIOD_NS, ARM, encode_get(P))
        assert len(arm.wire.advance(k * PERIOD_NS + 900_000)) == 7 - (k == 2)
        assert arm.wire.shortened == min(k + 1, 2)
        if k == 1:
            arm.network.faults.drop(position_reply_id(3))


@pytest.mark.parametrize("name", EVENTS)
def test_one_kind_of_event_at_any_time_changes_nothing_between_them(name):
    drive(ACTIVE, 3, cycles=150, events=(name,), share=0.05)


@pytest.mark.parametrize("seed", range(6))
def test_all_kinds_of_events_change_nothing_between_them(seed):
    events = [name for name in EVENTS if name not in BUS_FAULTS]
    # Most of what happens stops the arm: every second event lets it work again.
    again = ("wake", "button", "heard again", "relaxed", "slow again", "alone again")
    drive(ACTIVE, seed, cycles=1000, events=[*events, *again * 5], share=0.05)
