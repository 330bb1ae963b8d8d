"""The whole program with one fault in one phase, and the arm as seen by its pucks."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import experiments.run.runner
import experiments.run.session
from acquisition.clock import PERIOD_NS, Clock
from acquisition.control_loop.cycle import Cycle
from acquisition.control_loop.guard import GuardLimits
from acquisition.control_loop.states import ArmState
from acquisition.devices import SafetyMode
from acquisition.trial_file.verify import verify_file
from experiments.calibration import gravity
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.prompts import Prompt
from experiments.run import pose_walk
from fakes.pucks.bank import PuckBank
from fakes.world import plain_world
from fakes.world.rig import FakeRig, LocalSimulation
from tests.experiments.program import Done, journal, run_short, sidecar, traction
from tests.faults.phases import MOVING
from tests.faults.truth import TruthLog, watch_truth
from wam.calibration import poses

MS = 1_000_000
CALIBRATION = "gravity.toml"
_AFTERWARDS_NS = 500 * MS
MOVING_SPEED = 0.3  # rad/s; the move is under way
_FRESH_NS = 5 * MS  # torques older than two cycles are the last ones
_PROMPTS = {
    "tare": (Prompt.LIFT, 0.9),  # at rest from 0.6 s on; the mean is being taken
    "ready": (Prompt.READY, 0.06),
    "recording": (Prompt.RECORDING, 0.2),
    "review": (Prompt.REVIEW, 0.06),
    "end": (Prompt.REVIEW, 0.1),
}


@dataclass(slots=True)
class SimulatedScene:
    """The simulated devices and the loop's cycle, which a fault can change."""

    rig: FakeRig
    clock: Clock
    patch: pytest.MonkeyPatch
    cycle: Cycle | None = None
    strikes: int = 0
    struck_ns: int | None = None
    heard_ns: int = 0
    seen: list[tuple[int, str, ArmState]] = field(default_factory=list)
    usual_limits: GuardLimits | None = None
    due: list[tuple[int, Callable[["SimulatedScene"], None]]] = field(
        default_factory=list
    )

    def act(self) -> None:
        """Carry out the actions that are due."""
        now_ns = self.clock.now_ns()
        ready = [action for at_ns, action in self.due if at_ns <= now_ns]
        self.due = [row for row in self.due if row[0] > now_ns]
        for action in ready:
            action(self)

    def clear_faults(self) -> None:
        """Restore the limits of the guard."""
        if self.usual_limits is not None:
            self.cycle.limits, self.usual_limits = self.usual_limits, None

    @property
    def arm(self) -> str:
        """The state of the arm as seen by its pucks."""
        network = self.rig.network
        if network.safety_mode is SafetyMode.E_STOP:
            return "without power"
        if self.rig.plant.is_idle:
            return "idle"
        is_fresh = network.schedule.now_ns - self.heard_ns < _FRESH_NS
        return "driven" if is_fresh else "last torques"

    def look(self) -> None:
        """Record the state of the arm when it has changed."""
        state = self.cycle.status.state if self.cycle else ArmState.IDLE
        now = (self.arm, state)
        if not self.seen or self.seen[-1][1:] != now:
            self.seen.append((self.clock.now_ns(), *now))

    def reached_ms(self, arm: str, state: ArmState | None) -> float | None:
        """Return the time from the strike to this state [ms]; None = never."""
        for at_ns, *found in self.seen_since():
            if found[0] == arm and state in (None, found[1]):
                return (at_ns - self.struck_ns) / MS
        return None

    def seen_since(self):
        """Return the states of the arm from the strike on."""
        before = [row for row in self.seen if row[0] <= self.struck_ns]
        after = [row for row in self.seen if row[0] > self.struck_ns]
        return [(self.struck_ns, *row[1:]) for row in before[-1:]] + after


@dataclass(frozen=True, slots=True)
class Seen:
    """The outcome of a run: messages, files, and states of the arm."""

    done: Done
    scene: SimulatedScene
    folder: Path | None
    data: Path
    truth: TruthLog

    @property
    def written(self) -> Path | None:
        """The written calibration; None = none was written."""
        path = self.data / CALIBRATION
        return path if path.exists() else None

    @property
    def events(self) -> list[dict]:
        return journal(self.folder) if self.folder else []

    @property
    def rejected(self) -> list[str]:
        """Return the reasons of the rejected attempts whose files are sound."""
        paths = sorted((self.folder / "rejected").glob("T???.mcap"))
        assert all(verify_file(p).sha256 == sidecar(p)["sha256"] for p in paths)
        return [sidecar(path)["reason"] for path in paths]


Strike = Callable[[SimulatedScene], None]


def run_with(inject: Strike, phase: str, config: Path, data: Path) -> Seen:
    """Run a session of one trial in which `inject` is called once, in `phase`.

    In the phase MOVING, run a short calibration of gravity instead.
    """
    with pytest.MonkeyPatch.context() as patch:
        logs, scenes = watch_truth(patch), _watch(patch)
        _at(patch, phase, scenes, inject)
        if phase == MOVING:
            done = _calibrate(patch, config, data)
        else:
            done = run_short(config, data, "TF", 1)
        _continue_simulation(scenes[0])
    found = [path for path in (data / "sessions").glob("2*") if path.is_dir()]
    return Seen(done, scenes[0], found[0] if found else None, data, logs[0])


def run_whole(
    inject: Strike, seconds: float, config: Path, data: Path, friction: float
) -> Seen:
    """Run a session of one whole trial; call `inject` after `seconds` of it."""
    with pytest.MonkeyPatch.context() as patch:
        logs, scenes = watch_truth(patch), _watch(patch)
        usual_answer = AutoOperator.answer

        def answer(operator, asked):
            scene = scenes[0]
            is_due = asked.prompt is Prompt.RECORDING and asked.since > seconds
            if is_due and not scene.strikes:
                scene.strikes += 1
                scene.struck_ns = scene.clock.now_ns()
                inject(scene)
            return usual_answer(operator, asked)

        patch.setattr(AutoOperator, "answer", answer)
        options = ("--fake", "--fast", "--operator-script", "auto", "--trials", 1)
        more = ("--friction", friction, "--config", config, "--data", data)
        done = traction("run", "TF", *options, *more)
        _continue_simulation(scenes[0])
    folder = next((data / "sessions").glob("2*"))
    return Seen(done, scenes[0], folder, data, logs[0])


def _continue_simulation(scene: SimulatedScene) -> None:
    """Continue the simulation after the end of the program."""
    rig, clock = scene.rig, scene.clock
    for cycle in range(_AFTERWARDS_NS // PERIOD_NS):
        rig.advance(clock.now_ns() + (cycle + 1) * PERIOD_NS)


def _calibrate(patch: pytest.MonkeyPatch, config: Path, data: Path) -> Done:
    """Calibrate in the fewest poses, close to each other, with short stops."""
    patch.setattr(pose_walk, "SETTLE", 0.1)
    patch.setattr(gravity, "AVERAGE", 0.1)
    patch.setattr(poses, "APPROACH_SPEED", 0.1)
    patch.setattr(poses, "REACH", 0.6 * poses.REACH)
    data.mkdir()
    options = ("--fake", "--fast", "--poses", 3, "--force", "--config", config)
    out = ("--data", data, "--to", data / CALIBRATION)
    return traction("calibrate", "gravity", *options, *out)


def resume(data: Path) -> Done:
    """Resume the session on a repaired rig."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(AutoOperator, "answer", lambda _, asked: _press(asked))
        return traction("resume", "--operator-script", "auto", "--data", data)


def copied(data: Path, target: Path) -> Path:
    """Return a copy of a data folder."""
    shutil.copytree(data, target)
    return target


def _press(asked) -> str:
    """Return the key for a short session."""
    waits = {Prompt.READY: (0.3, " "), Prompt.RECORDING: (0.5, " ")}
    waits[Prompt.UNDO] = (0.3, " ")
    wait, key = waits.get(asked.prompt, (0.3, "k"))
    if asked.prompt in {Prompt.SUPPORT, Prompt.PAUSED, Prompt.DAMPED}:
        return " "
    if asked.prompt is Prompt.LAY_DOWN:
        return "i"
    if asked.prompt is Prompt.LIFT:
        return "q" if asked.since > 15.0 else ""
    return key if asked.since > wait else ""


def _watch(patch: pytest.MonkeyPatch) -> list[SimulatedScene]:
    """Record every simulated rig, cycle and torque frame in the scenes."""
    scenes: list[SimulatedScene] = []

    class Rig(plain_world.FakeRig):
        def __init__(self, scene, constants, tool, clock, *arguments, **named):
            super().__init__(scene, constants, tool, clock, *arguments, **named)
            scenes.append(SimulatedScene(self, clock, patch))

    usual_receive = PuckBank.receive_torques

    def receive(bank, *given):
        scenes[-1].heard_ns = scenes[-1].rig.network.schedule.now_ns
        usual_receive(bank, *given)

    patch.setattr(PuckBank, "receive_torques", receive)
    usual_call = Cycle.__call__

    def call(cycle, tick):
        scene = scenes[-1]
        scene.cycle = cycle
        scene.act()
        try:
            usual_call(cycle, tick)
        finally:
            scene.look()

    usual_clear = LocalSimulation.clear_faults

    def clear_faults(simulation):
        scenes[-1].clear_faults()
        usual_clear(simulation)

    patch.setattr(LocalSimulation, "clear_faults", clear_faults)
    patch.setattr(plain_world, "FakeRig", Rig)
    patch.setattr(Cycle, "__call__", call)
    return scenes


def _at(patch, phase: str, scenes: list[SimulatedScene], inject: Strike) -> None:
    """Call `inject` once, in `phase`."""

    def strike_once() -> None:
        scene = scenes[0]
        if not scene.strikes:
            scene.strikes += 1
            scene.struck_ns = scene.clock.now_ns()
            inject(scene)

    usual_answer = AutoOperator.answer

    def answer(operator, asked):
        if phase == MOVING:
            qd = scenes[0].rig.plant.qd
            if asked.prompt is Prompt.MOVING and abs(qd).max() > MOVING_SPEED:
                strike_once()
            return usual_answer(operator, asked)
        prompt, since = _PROMPTS.get(phase, (None, 0.0))
        if asked.prompt is prompt and asked.since > since:
            is_first = not scenes[0].strikes
            strike_once()
            return "k" if phase == "end" else "" if is_first else _press(asked)
        return _press(asked) if phase != "end" or asked.prompt is not prompt else ""

    patch.setattr(AutoOperator, "answer", answer)
    if phase == "end":  # a person, who can undo the last verdict
        patch.setattr(AutoOperator, "who", "mk")
    if phase == "preflight":
        _before(patch, experiments.run.session, "run_preflight", strike_once)
    if phase == "idle":
        _before(patch, experiments.run.runner, "activate", strike_once, idle=0.2)


def _before(patch, module, name: str, first, idle: float = 0.0) -> None:
    usual = getattr(module, name)

    def replaced(*given, **named):
        first()
        if idle:  # the loop runs for a while without a request
            given[0].loop_client.advance(idle)
        return usual(*given, **named)

    patch.setattr(module, name, replaced)


def inject(name: str) -> Strike:
    """Return the strike of the rehearsal's fault `name`."""
    return lambda scene: LocalSimulation(scene.rig).inject(name)
