"""Every message of the catalogue, raised through the whole program."""

import functools
import json
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.control_loop import contact
from acquisition.control_loop.cycle import Cycle
from acquisition.control_loop.powered_tests import PoweredTestGoal, PoweredTestKind
from acquisition.control_loop.states import ArmState
from acquisition.devices import SafetyMode
from acquisition.ipc.child import ProcessLostError
from experiments.messages import CATALOGUE
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.prompts import Prompt
from experiments.preflight import preflight
from experiments.rig.arm_service import ArmService
from experiments.rig.backend import InProcessBackend
from experiments.rig.build import build_tool
from experiments.rig.requests import ExchangeTimes
from experiments.run import ready, runner
from experiments.run import tare as taring
from experiments.session.data_files import journal_line, parse_journal
from experiments.session.lock import session_lock
from experiments.session.reducer import replay
from experiments.session.store import list_sessions
from experiments.settings import load
from experiments.settings.load import load_settings
from ft_sensor import tare
from ft_sensor.calibration.fit import SensorFit
from ft_sensor.calibration.sensor_file import SensorCalibration, sensor_to_toml
from ft_sensor.payload import payload_of
from tests.experiments.built import Built, watch_builds
from tests.experiments.commands.test_shared_arm import SHARED_ARM
from tests.experiments.messages import pattern
from tests.experiments.program import (
    Done,
    digest,
    journal,
    only_session,
    run_watched,
    traction,
    write_config,
)
from tests.experiments.run.test_bus_faults import BUS_FAULTS
from wam.control.controller import FootController
from wam.driver import property_watch

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

AUTO = ("--operator-script", "auto")
IDLE, E_STOP = SafetyMode.IDLE, SafetyMode.E_STOP


# --- keys of a short session --------------------------------------------------------


def hurry(asked):
    """Key that keeps a session short and ends it after one fault."""
    if asked.prompt is Prompt.READY:
        return " " if asked.since > 0.05 else ""
    if asked.prompt is Prompt.RECORDING:
        return " " if asked.since > 0.8 else ""
    if asked.prompt is Prompt.REVIEW:
        return "k" if asked.trial == 1 else "q"
    if asked.prompt is Prompt.LIFT and asked.attempt > 1:
        return "q"
    return None


def once(prompt, act, since=0.1):
    """A `press` that calls `act(scene)` once, at `prompt`."""
    done = []

    def press(asked, scene):
        if asked.prompt is prompt and asked.since > since and not done:
            done.append(True)
            act(scene)
        return None if asked.prompt is not prompt else hurry(asked)

    return press


def give_up(prompt):
    return lambda asked, scene: "q" if asked.prompt is prompt else None


# --- the scene: a session of two trials, the first one kept -------------------------


@dataclass
class SimulatedScene:
    """A copy of the session on the disk, and the rig that works on it.

    Attributes:
        data: the data folder.
        config: the rig.toml that it was recorded with.
        patch: changes the program during a case.
        built: parts of the program that the case has built.
    """

    data: Path
    config: Path
    patch: pytest.MonkeyPatch
    built: Built = field(default_factory=Built)

    @property
    def rig(self):
        return self.built.rig

    @property
    def folder(self):
        return only_session(self.data)

    def watch(self, press=None):
        """Record the built objects; `press(asked, scene)` precedes `hurry`."""
        self.built = watch_builds(self.patch)
        usual = AutoOperator.answer

        def answer(keys, asked):
            key = press(asked, self) if press is not None else None
            key = hurry(asked) if key is None else key
            return usual(keys, asked) if key is None else key

        self.patch.setattr(AutoOperator, "answer", answer)


def resume(scene, *more, press=None) -> Done:
    scene.watch(press)
    return traction("resume", *AUTO, "--data", scene.data, *more)


@dataclass(frozen=True)
class Case:
    """How a message is raised, and its consequences.

    Attributes:
        act: raises the message in the scene.
        code: exit code of the command.
        mode: mode of the simulated arm at the end; None without an arm.
        words: part of the message that is not in the catalogue.
    """

    act: Callable[[SimulatedScene], Done]
    code: int
    mode: SafetyMode | None = IDLE
    words: str = ""


def tared(act=None, text="", words="") -> Case:
    """Case of a failed tare that is reported and repeated before the session ends."""
    more = ("--fault", text) if text else ()
    lift = once(Prompt.LIFT, act) if act else lambda *_: None

    def press(asked, scene):
        return "q" if asked.prompt is Prompt.READY else lift(asked, scene)

    return Case(lambda scene: resume(scene, *more, press=press), 5, words=words)


def fault(text, code=5, mode=IDLE, words="") -> Case:
    """Case of a fault raised on the command line."""
    act = functools.partial(_resume_with, text=text)
    return Case(act, code, mode, words)


def _resume_with(scene, text) -> Done:
    return resume(scene, "--fault", text)


def acted(prompt, act, code=5, words="", since=0.1) -> Case:
    """Case of an event that happens to the rig at `prompt`."""
    return Case(
        lambda scene: resume(scene, press=once(prompt, act, since)), code, words=words
    )


def struck(name, mode=IDLE, words="") -> Case:
    """Case of a device fault during the tare that ends the session."""

    def inject(scene):
        scene.rig.faults()[name]()

    return Case(
        lambda scene: resume(scene, press=once(Prompt.LIFT, inject)), 4, mode, words
    )


def struck_early(name, mode=IDLE, words="") -> Case:
    """Case of a device fault between the preflight and the pendant."""

    def act(scene):
        usual = preflight.check_wrenches

        def check(*arguments):
            scene.rig.faults()[name]()
            return usual(*arguments)

        scene.patch.setattr(preflight, "check_wrenches", check)
        return resume(scene)

    return Case(act, 3, mode, words)


def refused(act, code=2, words="") -> Case:
    """Case of a command that never reaches an arm."""
    return Case(act, code, None, words)


# --- what happens -------------------------------------------------------------------


def _never_active(scene):
    scene.patch.setattr(ready, "PATIENCE", 0.3)
    return resume(scene, press=lambda a, _: "" if a.prompt is Prompt.SUPPORT else None)


def _weak(scene):
    """Resume with a limit that gravity alone exceeds."""
    folder = scene.data.parent / "weak"
    folder.mkdir()
    change = ("torque = [20.0, 45.0", "torque = [20.0, 1.0")
    config = write_config(folder, rig=change)
    return resume(scene, "--force", "--config", config)


def _not_a_number(scene):
    scene.patch.setattr(
        FootController, "torque", lambda *_: (np.full(7, np.nan), np.zeros(7))
    )


def _deaf(scene):
    """Stop the console's heartbeat for 0.6 s."""
    loop_client, left = scene.built.backend.loop_client, [30]
    usual = loop_client.beat

    def beat():
        left[0] -= 1
        if left[0] < 0:
            usual()

    loop_client.beat = beat


def _orphan(scene):
    scene.built.loop_servers[-1].on_console_death()


def _ask_an_idle_arm(scene):
    loop_client = scene.built.backend.loop_client
    loop_client.idle()
    loop_client.request(ArmState.GUIDE)


def _stand_still_for_long(scene):
    """Make the next cycle the first one for 0.2 s."""
    usual, gaps = Cycle.__call__, [100]

    def call(cycle, tick):
        usual(cycle, tick._replace(skipped=gaps.pop() if gaps else 0))

    scene.patch.setattr(Cycle, "__call__", call)


def _stuck_recorder(scene):
    scene.built.backend.recorder.drain = lambda: None


def _move(scene):
    scene.built.backend.loop_client.move_to([0.0] * 7, 0.1)


def _lose_recorder(scene):
    def advance_cycles(cycles):
        raise ProcessLostError("recorder", "killed by signal 9")

    scene.built.backend.loop_client.advance_cycles = advance_cycles


def _swing(scene):
    """Swing the arm by hand, with its energy allowed."""
    cycle = scene.built.cycle
    motion = replace(cycle.limits.motion, float_energy=9.0)
    cycle.limits = replace(cycle.limits, motion=motion)
    scene.rig.plant.qd[1] = 1.45


def _swing_hard(scene):
    scene.rig.plant.qd[1] = 1.45


def _allow_no(travel):
    """A function that makes any travel of the sole exceed the limit `travel`."""

    def allow(scene):
        cycle = scene.built.cycle
        motion = replace(cycle.limits.motion, **{travel: 0.0})
        cycle.limits = replace(cycle.limits, motion=motion)

    return allow


def _test_at_rest(scene):
    """Take the torque from an arm that a hand carries, as if it lay on its stops."""
    scene.built.cycle.request(ArmState.HOLD)
    scene.built.cycle.start_powered_test(PoweredTestGoal(PoweredTestKind.REST))


def _damp_in_vain(scene):
    """Make joint 6 too fast, and damping too slow to stop it."""
    _allow_no("damp_travel")(scene)
    scene.rig.faults()["overspeed"]()


def _press_early(scene):
    """Resume; Shift-activate is pressed before it is asked for."""
    usual = runner.activate

    def activate(console_loop):
        scene.rig.network.pendant("activate")
        console_loop.loop_client.advance(0.2)
        usual(console_loop)

    scene.patch.setattr(runner, "activate", activate)
    return resume(scene)


def _meet(scene):
    """Make the arm appear to move by itself, and its foot to meet something."""
    scene.patch.setattr(FootController, "is_moving", lambda _: True)
    cycle = scene.built.cycle
    cycle.limits = replace(cycle.limits, contact_force_move=0.01)


def _pull_in_vain(scene):
    scene.patch.setattr(FootController, "stuck_motor", lambda _: 2)


def _stand_still(scene):
    """Make any travel of motor 1 exceed the limit of an arm at rest."""
    cycle = scene.built.cycle
    cycle.limits = replace(cycle.limits, still_travel=(1e-4, *[1.0] * 6))


def _narrow(scene):
    """Limit joint 6, which is at 1.2 rad, to 1 rad."""
    cycle = scene.built.cycle
    upper = (*cycle.limits.q_upper[:5], 1.0, cycle.limits.q_upper[6])
    cycle.limits = replace(cycle.limits, q_upper=upper)


def _tender(scene):
    """Make the weight of a push exceed the limit of the moment."""
    cycle = scene.built.cycle
    cycle.limits = replace(cycle.limits, contact_moment=0.001)


def _lean(scene):
    """Press harder than a push on a foot that counts as standing at once."""
    scene.patch.setattr(contact, "STANDING", 1.0)
    scene.rig.plant.finger = (0.0, 0.0, 60.0)


def _saturate(scene):
    scene.rig.faults()["ft-saturated"]()


def _plug_in_another(scene):
    """Unplug the sensor and report another one, as the sensor process of a rig does."""
    scene.rig.faults()["ft-unplugged"]()
    fields = {"trouble": "Another F/T sensor was plugged in: 7, not 3."}
    scene.patch.setattr(InProcessBackend, "sensor_metadata", lambda _: fields)


def _no_exchange(scene):
    scene.patch.setattr(ArmService, "measure_exchange", lambda _: ExchangeTimes([]))
    return resume(scene)


def _late_replies(scene):
    """Delay replies from the check of the sensor on, before the exchange is timed."""
    usual = preflight.reach_words

    def words(*arguments):
        scene.rig.faults()["replies-late"]()
        return usual(*arguments)

    scene.patch.setattr(preflight, "reach_words", words)
    return resume(scene)


def _changed_puck(scene):
    """Watch one property only, so that a short session polls it."""

    def change(scene):
        scene.rig.faults()["puck-changed"]()

    scene.patch.setattr(property_watch, "WATCHED", ("IPNM",))
    return resume(scene, press=once(Prompt.LIFT, change))


def _no_loop(scene):
    scene.patch.setattr(preflight, "loop_report", lambda _: None)
    return resume(scene)


def _lost_sensor(scene):
    fields = {"trouble": "The port is gone.", "reopened": "0"}
    scene.patch.setattr(InProcessBackend, "sensor_metadata", lambda _: fields)
    return resume(scene)


def _locked(scene):
    (folder,) = list_sessions(scene.data)
    with session_lock(folder):
        scene.watch()
        return traction("resume", "S001", *AUTO, "--data", scene.data)


def _run(scene, terrain="TF", *more):
    options = ("--fake", "--fast", *AUTO, "--config", scene.config)
    return traction("run", terrain, *options, "--data", scene.data, *more)


def _kill(scene):
    """Resume in a fork that kills itself in the second trial."""
    child = os.fork()
    if child == 0:
        try:
            resume(scene, "--fault", "crash@T2+0.3s")
        finally:
            os._exit(1)
    assert os.WIFSIGNALED(os.waitpid(child, 0)[1])


def _crashed_run(scene):
    _kill(scene)
    return _run(scene)


def _crashed_resume(scene):
    _kill(scene)
    return resume(scene, press=give_up(Prompt.SUPPORT))


def _complete(scene):
    """Make the kept trial the last one, and cut the end of the session's journal."""
    path = scene.folder / "events.jsonl"
    first, *rest, _ = path.read_bytes().splitlines(keepends=True)
    ((begun,), _) = parse_journal(first)
    start = journal_line({**begun, "trials": 1}, 1)
    path.write_bytes(b"".join([start, *rest]))
    summary = scene.folder / "session.json"
    fields = {**json.loads(summary.read_text()), "events": 1 + len(rest)}
    summary.write_text(json.dumps(fields))
    return resume(scene)


def _failing_status(scene, error):
    def fail(_):
        raise error

    scene.patch.setattr(load, "load_settings", fail)
    return traction("status", "--data", scene.data)


def _bad_config(scene):
    folder = scene.data.parent / "bad"
    folder.mkdir()
    config = write_config(folder, matrix=("trials = 10", 'trials = "ten"'))
    return traction("run", "TF", "--fake", "--config", config, "--data", scene.data)


def _mixed(scene):
    live = scene.folder.with_name("2027-01-01_S002_TF")
    shutil.copytree(scene.folder, live)
    done = traction("report", "S001", "S002", "--data", scene.data)
    shutil.rmtree(live)
    return done


def _other_foot(scene):
    """Answer no to the question about the foot, after a session with the other one."""
    newer = scene.folder.with_name("2027-01-01_S002_Tf.fake")
    newer.mkdir()
    (newer / "conditions.json").write_text('{"terrain.foot": "bare"}')
    (newer / "events.jsonl").write_text("")
    scene.watch(give_up(Prompt.FOOT))
    done = traction("resume", "S001", *AUTO, "--data", scene.data)
    shutil.rmtree(newer)
    return done


def _turned_sensor(scene):
    """Begin a session with a calibration made before the sensor was turned round."""
    folder = scene.data.parent / "turned"
    folder.mkdir()
    change = ("sign = 1 ", 'calibration = "ft_sensor.toml"\nsign = 1 ')
    config = write_config(folder, rig=change)
    payload = payload_of(build_tool(load_settings(scene.config).rig, "tread"))
    fit = SensorFit(payload.mass, payload.com, np.zeros(6), np.pi, 1.0, 0.05, 0.001)
    poses = np.stack([np.eye(3)] * 6)
    old = SensorCalibration(fit, "tread", 0.1, "2026", True, poses, np.zeros((6, 6)))
    (folder / "ft_sensor.toml").write_text(sensor_to_toml(old))
    scene.watch()
    options = ("--fake", "--fast", *AUTO, "--config", config)
    return traction("run", "TF", *options, "--data", folder / "data")


def _no_end_tare(scene):
    def press(asked, _):
        if asked.prompt is Prompt.REVIEW:
            return "k"
        return "q" if asked.prompt is Prompt.LIFT and asked.trial == 0 else None

    return resume(scene, press=press)


CASES = {
    # found by a preflight
    "can-down": fault("can-down", 3, words="failed: Network is down"),
    "puck-missing": fault("puck-missing", 3, words="Puck 5 does not answer (1,2,3,4,6"),
    "not-zeroed": fault("not-zeroed", 3),
    "ft-silent": fault("ft-silent", 3, words="No F/T data for 100 ms (port open, 0"),
    "disk-full": fault("disk-full@T0+0s", 3, words="2.1 GB free"),
    "exchange-late": Case(_late_replies, 3, words="in 5 of 5 cycles"),
    "exchange": Case(_no_exchange, 3, words="100 of 100 exchanges"),
    "loop-dead": Case(_no_loop, 3),
    "ft-lost": Case(_lost_sensor, 3, words="during its test: The port is gone."),
    "not-active": Case(_never_active, 3),
    "no-power": struck_early("estop", E_STOP),
    "not-ready": struck_early("puck-silent", words="Puck 3 has not answered for "),
    # faults that end a trial, not the session: no second attempt is begun here
    "ft-stale": fault("ft-stale@T2+0.1s", words="T02 stopped at 0.1 s"),
    "ft-saturated": fault("ft-saturated@T2+0.1s", words="range for 102 ms"),
    "contact-force": fault("contact-force@T2+0.1s", words="N on the foot (limit 100)"),
    "contact-moment": acted(Prompt.RECORDING, _tender, words="N m on the foot (limit"),
    "contact-move": acted(
        Prompt.READY, _meet, 4, words="beyond its weight (limit 0)", since=0.0
    ),
    "contact-growth": acted(
        Prompt.RECORDING, _lean, words="while it stood still (limit 40)"
    ),
    "loop-late": fault("loop-late@T2+0.1s", words="11 late cycles"),
    "overspeed": fault("overspeed@T2+0.1s", words="Joint 6 "),
    "joint7-slip": fault("joint7-slip@T2+0.1s", words="(limit 50)"),
    "foot-speed": acted(Prompt.RECORDING, _swing),
    "kinetic-energy": acted(Prompt.RECORDING, _swing_hard, 4, "kinetic energy was"),
    "damp-motion": acted(Prompt.RECORDING, _damp_in_vain, 4, "the sole's travel was"),
    "hold-motion": acted(Prompt.LIFT, _allow_no("hold_travel"), 4, "(limit 0.00)"),
    "proof-motion": acted(Prompt.RECORDING, _test_at_rest, 4, "kinetic energy was"),
    "activation-motion": acted(
        Prompt.SUPPORT, _allow_no("activation_travel"), 4, "(limit 0.00)", since=-1.0
    ),
    "not-asked-active": Case(_press_early, 4),
    "joint-limit": acted(Prompt.LIFT, _narrow, 4, words="Joint 6 at "),
    "torque-limit": Case(_weak, 4, words="Joint 2 would need"),
    "console-silent": acted(Prompt.READY, _deaf, since=0.0),
    "recorder-silent": acted(Prompt.RECORDING, _stuck_recorder),
    "move-refused": acted(Prompt.RECORDING, _move),
    # problems of a tare
    "tare-moved": tared(text="tare-moved@T2+0.25s", words="Force varied "),
    "residual": tared(text="residual@T2+0s", words="feet.tread.mass 0.450 kg"),
    "tare-without-sensor": replace(
        tared(_plug_in_another, words="read: Another F/T sensor was"), code=3
    ),
    "tare-poor": tared(_saturate, words="were flagged during tare"),
    "mounting": Case(_turned_sensor, 3, words="degrees about z"),
    "no-end-tare": Case(_no_end_tare, 0, words="left out as asked."),
    # faults that end the session; those of the bus in a trial: test_bus_faults
    "safety-silent": struck("safety-silent"),
    "replies-late": struck("replies-late", words="Pucks 1,2,3,4,5,6,7 have answered"),
    "position-jump": struck("position-jump"),
    "bus-shared": struck("bus-shared", words="frame 4"),
    "puck-changed": Case(_changed_puck, 4, words="IPNM of puck 3 was 2700"),
    "pendant-idle": struck("pendant-idle"),
    "motor-stuck": acted(Prompt.LIFT, _pull_in_vain, 4, "Motor 2 does not turn"),
    "motor-still": acted(Prompt.RECORDING, _stand_still, 4, "(limit 0)"),
    "not-a-number": acted(Prompt.LIFT, _not_a_number, 4),
    "console-lost": acted(Prompt.READY, _orphan, 4, since=0.0),
    "arm-not-active": acted(Prompt.LIFT, _ask_an_idle_arm, 4),
    "puck-disobeys": struck("mode-lost-4", words="Puck 4 does not"),
    "puck-doubled": struck("puck-doubled", words="Puck 3 sends more replies"),
    "loop-lost": acted(Prompt.LIFT, _stand_still_for_long, 4, "for 200 ms"),
    "process-lost": acted(Prompt.LIFT, _lose_recorder, 4, "recorder process ended"),
    # disk, lock, kill, bug
    "disk-lost": fault("disk-full@T2+0.1s", 6, words="T02 stopped at 0."),
    "write-failed": fault("write-failed@T2+0.6s", 6, words="T02 could not be verified"),
    "locked": refused(_locked, words=f"in process {os.getpid()} since"),
    "crash": refused(_crashed_run, words="S001 ended without closing (T02 at "),
    "put-away": Case(_crashed_resume, 5, words="are in rejected/T02a.*"),
    "complete": refused(_complete, 0),
    "bug": fault("bug@T2+0.1s", 1, words="InjectedBugError: rehearsed."),
    "command-bug": refused(lambda s: _failing_status(s, ZeroDivisionError("so")), 1),
    # impossible requests
    "config": refused(_bad_config, words='cells[0].trials = "ten" - expected a w'),
    "mismatch": refused(
        lambda s: _run(s, "S0"),
        words="Session S001 of TF is unfinished, but you asked for S0",
    ),
    "unfinished": refused(_run, words="S001 TF is unfinished, 1 of 2 kept."),
    "mixed": refused(_mixed),
    "nobody": refused(lambda scene: traction("run", "TF", "--data", scene.data)),
    "foot-changed": Case(_other_foot, 2, words="S002 was recorded with the foot bare"),
    "interrupted": Case(lambda s: resume(s, press=give_up(Prompt.LIFT)), 5),
    "nothing-lost": refused(lambda s: _failing_status(s, KeyboardInterrupt()), 130),
}


@pytest.fixture(scope="module")
def base(tmp_path_factory, config):
    """The data of a session that was left after one kept trial of two."""

    def press(asked, rig):
        second = asked.prompt is Prompt.LIFT and asked.trial == 2
        if asked.prompt is Prompt.RECORDING:
            return " " if asked.since > 0.3 else ""
        return "q" if second else hurry(asked)

    data = tmp_path_factory.mktemp("base") / "data"
    seen = run_watched(config, data, 2, press=press)
    assert replay(journal(seen.folder)).kept == (1,)
    return data


@pytest.fixture
def scene(base, config, tmp_path, monkeypatch):
    """A copy of the base with short tares; other tests check full ones."""
    shutil.copytree(base, tmp_path / "data")
    monkeypatch.setattr(taring, "TARE_SECONDS", 0.5)
    monkeypatch.setattr(tare, "MIN_DURATION", 0.4)
    return SimulatedScene(tmp_path / "data", config, monkeypatch)


def files_of_first(scene):
    paths = (scene.folder / "trials").glob("T01.*")
    return {path.name: (digest(path), path.stat().st_mtime_ns) for path in paths}


# Depends on what else the computer does: tests/experiments/test_messages.py.
OF_THE_COMPUTER = {"too-busy"}
# Of a real arm only: tests/experiments/commissioning/test_gate.py.
OF_THE_FIRST_DAY = {"daily-ahead"}


def test_every_row_of_the_catalogue_has_a_case():
    elsewhere = SHARED_ARM | BUS_FAULTS | OF_THE_COMPUTER | OF_THE_FIRST_DAY
    assert set(CASES) | elsewhere == set(CATALOGUE)


@pytest.mark.parametrize("name", CASES)
def test_a_message_has_its_exit_code_and_earlier_trials_stay_unchanged(scene, name):
    case, before = CASES[name], files_of_first(scene)
    done = case.act(scene)
    matches = [
        line
        for line in f"{done.err}\n{done.out}".splitlines()
        if re.search(pattern(name), line) and case.words in line
    ]
    assert matches, done.err + done.out
    assert done.code == case.code
    assert len(before) == 3  # the trial, its sidecar, the truth
    assert files_of_first(scene) == before
    assert "Traceback" not in done.err + done.out
    if case.mode is not None:
        network = scene.rig.network
        assert network.safety_mode is case.mode
        assert scene.rig.plant.is_idle  # all windings are shorted
