"""A rig without devices for the console loop and the steps that run on it."""

import io
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import BusCondition, SafetyMode
from experiments.operator.console import Console
from experiments.rig.pace import WallPace
from experiments.run.console_loop import ConsoleLoop
from experiments.run.context import RunContext
from experiments.run.stop import StopFlag
from experiments.run.trial import SessionMetadata
from experiments.session.journal import Journal
from experiments.session.states import Event
from experiments.session.store import create_session
from fakes.clock import SteppedClock


@dataclass
class StubClient:
    """Loop in which only that happens which the test sets."""

    clock: SteppedClock
    status: ControlStatus = field(default_factory=ControlStatus)
    advanced: float = 0.0
    requested: list = field(default_factory=list)
    known: int = 0
    on_advance: list = field(default_factory=list)
    loop: SimpleNamespace = field(
        default_factory=lambda: SimpleNamespace(
            bus_condition=BusCondition.SOUND, is_running=True
        )
    )

    def advance(self, seconds):
        self.advanced += seconds
        self.clock.sleep_until(self.clock.now_ns() + round(seconds * 1e9))
        for look in self.on_advance:
            look()

    def request(self, state):
        self.requested.append(state)

    def start(self):
        self.requested.append(ArmState.HOLD)

    def watch_trial(self, *, is_recording):
        assert not is_recording

    def note(self, control):
        self.known = control.number

    def is_news(self, control):
        return control.verdict is not None and control.number > self.known

    def last(self, seconds):
        del seconds
        return np.zeros(0)


class Keys:
    """Operator who presses the given keys, one per look, then nothing."""

    draft = ""
    who = "mk"

    def __init__(self, *keys, lines=()):
        self.keys, self.lines = list(keys), list(lines)
        self.states = []

    def answer(self, state):
        self.states.append(state)
        return self.keys.pop(0) if self.keys else ""

    def line(self, state):
        self.states.append(state)
        return self.lines.pop(0) if self.lines else ""


class StubBackend:
    """Backend that is idle at once."""

    def __init__(self, client):
        self.loop_client = client
        self.recorder = SimpleNamespace(abandon=lambda: None)
        self.stream: dict[str, str] = {}

    def sensor_metadata(self):
        return self.stream

    def idle(self):
        return True

    def safety_mode(self):
        return SafetyMode.IDLE


def make_loop(operator, *, is_stepped=True, console=None, wall=None, **more):
    """Console loop over a rig without devices; `wall` paces it as for a person."""
    clock = SteppedClock()
    rig = SimpleNamespace(
        clock=clock,
        backend=StubBackend(StubClient(clock)),
        simulation=None,
        is_stepped=is_stepped,
        pace=None if wall is None else WallPace(clock, wall),
        is_simulated=True,
        settings=SimpleNamespace(
            rig=SimpleNamespace(operator=SimpleNamespace(double_tap=False))
        ),
    )
    return ConsoleLoop(rig, console or Console(), operator, StopFlag(), **more)


def printed_by(work):
    """Text that `work` prints."""
    out = io.StringIO()
    with redirect_stdout(out):
        work()
    return out.getvalue()


def make_context(data, operator, *, trials=2, **more):
    """Context of a session in `data` that waits for its first trial."""
    loop = make_loop(operator, **more)
    folder = create_session(data, "TF", is_simulated=True, utc_ns=0)
    journal = Journal(folder, loop.rig.clock)
    journal.append(Event.STARTED, terrain="TF", trials=trials)
    journal.append(Event.ACTIVATED)
    loop.rig.row = SimpleNamespace(name="TF", reset=(), trials=trials)
    loop.rig.frame = SimpleNamespace(travel=0.4)
    return RunContext(
        console_loop=loop,
        rig=loop.rig,
        console=loop.console,
        operator=operator,
        stop=loop.stop,
        metadata=SessionMetadata(folder, "mk", None, {}, ""),
        journal=journal,
        archive=SimpleNamespace(),
        feedback=SimpleNamespace(),
        opened_ns=loop.rig.clock.now_ns(),
        kept_before=0,
    )
