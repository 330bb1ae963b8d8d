"""C4: the stop button, the pendant and the module, the arm idle and supported."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from acquisition.clock import PERIOD_NS
from acquisition.control_loop.faults import Fault
from acquisition.devices import SafetyMode
from acquisition.errors import PreflightError
from acquisition.sample import MOTOR_FRESH_SHIFT, SAFETY_MODE_MASK
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.judging import Judgement, judge_quantity, judged
from experiments.commissioning.recording import Values
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step

_PATIENCE = 60.0  # s, time-out of each press
_RELEASED = 2.0  # s, time that E-stop must last after the release
_AFTER = 0.5  # s, recorded after the last press
_SILENT_CYCLES = 20  # cycles without any reply: no power
_REPORT_NS = 100_000_000  # latency of the loop's status
_MS = PERIOD_NS / 1e6


def collect(scene: Scene) -> Values:
    """Have the pendant pressed four times; returns the recording.

    Raises:
        PreflightError: a press was not detected.
        StopRequestedError: as `ConsoleLoop.tick`.
    """
    simulation = scene.simulation
    reader = scene.rig.shared.cycles.reader()
    seen: list[bool] = []
    scene.say("One person supports the arm throughout: it is idle, it sinks slowly.")
    scene.say("1/4 Press Shift-activate, though nobody has asked for it.")
    if simulation is not None:
        simulation.pendant("activate")
    seen.append(_await_mode(scene, SafetyMode.ACTIVE, "Shift-activate"))
    early_ns = scene.rig.clock.now_ns()
    scene.wait_through(1.0)
    scene.say("2/4 Press the stop button.")
    if simulation is not None:
        simulation.pendant("estop")
    seen.append(_await_mode(scene, SafetyMode.E_STOP, "the stop button"))
    scene.ask_through("3/4 Release the stop button, press nothing else, then [space].")
    released_ns = scene.rig.clock.now_ns()
    scene.wait_through(_RELEASED)
    idled_ns = scene.rig.clock.now_ns()
    scene.say("4/4 Press Shift-idle.")
    if simulation is not None:
        simulation.pendant("idle")
    seen.append(_await_mode(scene, SafetyMode.IDLE, "Shift-idle"))
    scene.wait_through(_AFTER)
    record = reader.read()
    return {
        "t_ns": record["host_ns"].astype(np.int64),
        "mode": (record["flags"] & SAFETY_MODE_MASK).astype(np.int64),
        "fresh": (record["flags"] >> MOTOR_FRESH_SHIFT & 0x7F).astype(np.int64),
        "seen": np.array(seen),
        "early_ns": np.array(early_ns),
        "released_ns": np.array(released_ns),
        "idled_ns": np.array(idled_ns),
    }


def _await_mode(scene: Scene, mode: SafetyMode, button: str) -> bool:
    """Wait until the module has been in `mode`.

    Raises:
        PreflightError: time-out after a minute.
    """
    reader = scene.rig.shared.cycles.reader()

    def is_seen() -> bool:
        modes = reader.read()["flags"] & SAFETY_MODE_MASK
        verdict = scene.loop_client.status.verdict
        is_early = verdict is not None and verdict.fault is Fault.UNREQUESTED_ACTIVE
        return bool((modes == mode).any()) or (mode is SafetyMode.ACTIVE and is_early)

    if not _await(scene, is_seen):
        raise PreflightError(
            f"{button[0].upper()}{button[1:]} was not seen within {_PATIENCE:.0f} s.",
            hint="Check the pendant and its cable, then begin the step again.",
            arm_state="idle; it sinks slowly, support it",
        )
    return True


def _await(scene: Scene, is_done: Callable[[], bool]) -> bool:
    waited = 0.0
    while not is_done():
        scene.show_share(waited / _PATIENCE, "waiting for the pendant")
        scene.wait_through(0.02)
        waited += 0.02
        if waited > _PATIENCE:
            return False
    return True


def judge(values: Values) -> Judgement:
    """Judge a recording of `collect`."""
    t_ns, mode, fresh = values["t_ns"], values["mode"], values["fresh"]
    stop = mode == SafetyMode.E_STOP
    first = int(stop.argmax()) if stop.any() else len(stop)
    early = max(
        _longest(t_ns, mode[:first] == SafetyMode.ACTIVE),
        _longest_pause(t_ns, int(values["early_ns"])),
    )
    silent = _silent_since(fresh, first)
    stopped = 1e9 if silent is None else max(0.0, float(silent - first) * _MS)
    kept = (t_ns > int(values["released_ns"])) & (t_ns < int(values["idled_ns"]))
    is_idle = bool(len(mode)) and int(mode[-1]) == SafetyMode.IDLE
    return judged(
        [
            judge_quantity("seen", int(values["seen"].sum())),
            judge_quantity("early", early / 1e6),
            judge_quantity("stop", stopped),
            judge_quantity("stays", int((mode[kept] != SafetyMode.E_STOP).sum())),
            judge_quantity("idles", int(is_idle)),
            judge_quantity("asleep", int(fresh[-1]).bit_count() if len(fresh) else 0),
        ]
    )


def _longest(t_ns: NDArray[np.int64], is_so: NDArray[np.bool_]) -> int:
    """Longest time from a cycle in which `is_so` holds to the next without it [ns].

    There are no cycles while the module is set to idle: that time lies between two of
    them.
    """
    times = t_ns.tolist()
    longest, since = 0, None
    for i, holds in enumerate(is_so.tolist()):
        if holds and since is None:
            since = i
        elif since is not None and not holds:
            longest, since = max(longest, times[i] - times[since]), None
    if since is not None:
        longest = max(longest, times[len(is_so) - 1] - times[since])
    return longest


def _longest_pause(t_ns: NDArray[np.int64], early_ns: int) -> int:
    """Longest time between two cycles about `early_ns` [ns].

    The cycle that finds the module active sets it to idle and reports its mode
    afterwards: if the module obeys, or its heartbeat brakes meanwhile, no cycle reports
    that it was active.
    """
    is_near = (t_ns[1:] > early_ns - _REPORT_NS) & (t_ns[:-1] < early_ns)
    return int(np.diff(t_ns)[is_near].max(initial=0))


def _silent_since(fresh: NDArray[np.int64], stop: int) -> int | None:
    """First cycle from which on no puck answers after a stop, or None."""
    run = 0
    for i in range(max(0, stop - _SILENT_CYCLES), len(fresh)):
        run = run + 1 if fresh[i] == 0 else 0
        if run == _SILENT_CYCLES:
            return i - _SILENT_CYCLES + 1
    return None


STOP_CIRCUIT = Step(
    StepId.STOP_CIRCUIT,
    collect,
    judge,
    minutes=5,
    remedy="Do not go on without a stop that works: pendant, its cable, the module.",
    needs_loop=True,
)
