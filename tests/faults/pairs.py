"""Two faults in succession: every ordered pair, delay and phase.

For every pair, each verdict that the loop latched is reported; once one of them idles
the arm, no key of the pendant lets it be driven again; the session ends if either fault
ends it; and no trial is kept in which the motors had no power.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Formatter

from acquisition.control_loop.faults import Action, Fault, GuardVerdict, verdict_for
from acquisition.control_loop.states import ControlStatus
from acquisition.devices import SafetyMode
from acquisition.sample import SAFETY_MODE_MASK
from acquisition.trial_file.reader import TrialReader
from experiments.messages import CATALOGUE
from tests.attacks.attack import Attack, RunBy
from tests.experiments.program import write_config
from tests.faults.phases import MOVING
from tests.faults.rehearse import MS, Seen, SimulatedScene, Strike, run_with
from tests.faults.strikes import strike_of

DELAYS_MS = (0, 20, 60, 100, 140, 200, 500)
PHASES = ("idle", "tare", "ready", "recording", "review", MOVING)
_RELEASED_NS = 300 * MS  # from a fault of the circuit to the keys idle and activate


def _reported(fault: Fault) -> Strike:
    """Return a strike in which another process reports a fault."""
    return lambda scene: scene.cycle.report(verdict_for(fault))


# Faults that cover every reaction of the guard, by the name of their row.
STRIKES: dict[str, Strike] = {
    # End a trial, or hold.
    "contact-force": strike_of("contact-force"),
    "ft-stale": strike_of("ft-stale"),
    "console-silent": _reported(Fault.CONSOLE_SILENT),
    "recorder-silent": _reported(Fault.RECORDER_SILENT),
    "move-refused": _reported(Fault.MOVE_REFUSED),
    # Damp.
    "overspeed": strike_of("overspeed"),
    "joint-limit": strike_of("joint-limit"),
    # Hold, then idle.
    "puck-silent": strike_of("puck-silent"),
    "can-silence": strike_of("can-silence"),
    "position-jump": strike_of("position-jump"),
    "replies-late": strike_of("replies-late"),
    "safety-silent": strike_of("safety-silent"),
    # Idle.
    "bus-shared": strike_of("bus-shared"),
    "puck-doubled": strike_of("puck-doubled"),
    "not-a-number": strike_of("not-a-number"),
    "safety-heartbeat": strike_of("safety-heartbeat"),
    "pendant-idle": strike_of("pendant-idle"),
    "estop": strike_of("estop"),
}
_OF_THE_CIRCUIT = ("estop", "pendant-idle", "safety-heartbeat")


@dataclass(frozen=True, slots=True)
class Pair:
    """Two faults, the second `delay_ms` after the first, which occurs in `phase`."""

    first: str
    second: str
    delay_ms: int
    phase: str

    def __str__(self) -> str:
        return f"{self.first}, {self.second} after {self.delay_ms} ms, {self.phase}"


# For each commit: pairs that differ in kind.
EVERY_COMMIT = (
    # First a fault that only holds, then one that idles.
    Pair("ft-stale", "pendant-idle", 100, "recording"),
    Pair("console-silent", "bus-shared", 60, "ready"),
    Pair("contact-force", "estop", 140, "recording"),
    Pair("move-refused", "position-jump", 60, "tare"),
    # First a fault that damps, then one that idles, and the reverse.
    Pair("overspeed", "pendant-idle", 100, "recording"),
    Pair("pendant-idle", "overspeed", 20, "recording"),
    # First a fault that idles, then one that only holds.
    Pair("estop", "console-silent", 20, "review"),
    # A fault that holds, with one that holds and idles later.
    Pair("move-refused", "can-silence", 0, "review"),
    # During an autonomous move.
    Pair("joint-limit", "puck-silent", 20, MOVING),
)


def every_pair() -> Iterator[Pair]:
    """Yield every ordered pair of different faults, with every delay and phase."""
    for phase in PHASES:
        for delay_ms in DELAYS_MS:
            for first in STRIKES:
                for second in STRIKES:
                    if first != second:
                        yield Pair(first, second, delay_ms, phase)


def problems_of(pair: Pair, config: Path, data: Path) -> list[str]:
    """Run a session, or a calibration, with the pair; return the problems."""
    latched: list[tuple[int, GuardVerdict]] = []
    scenes: list[SimulatedScene] = []

    def strike(scene: SimulatedScene) -> None:
        scenes.append(scene)
        usual_latch = ControlStatus.latch

        def latch(status: ControlStatus, verdict: GuardVerdict) -> None:
            latched.append((scene.clock.now_ns(), verdict))
            usual_latch(status, verdict)

        scene.patch.setattr(ControlStatus, "latch", latch)
        STRIKES[pair.first](scene)
        at_ns = scene.clock.now_ns() + pair.delay_ms * MS
        scene.due.append((at_ns, STRIKES[pair.second]))
        for name, struck_ns in (
            (pair.first, scene.clock.now_ns()),
            (pair.second, at_ns),
        ):
            if name in _OF_THE_CIRCUIT:
                scene.due.append((struck_ns + _RELEASED_NS, _release))

    seen = run_with(strike, pair.phase, config, data)
    return [
        *_unreported(seen, latched),
        *_driven_again(seen, latched),
        *_not_ended(seen, latched),
        *_kept_without_power(seen),
    ]


def _release(scene: SimulatedScene) -> None:
    """Press Shift-idle and Shift-activate without a request by the program."""
    network = scene.rig.network
    if network.safety_mode is not SafetyMode.ACTIVE:
        network.pendant("idle")
        network.pendant("activate")


def _unreported(seen: Seen, latched: Sequence[tuple[int, GuardVerdict]]) -> list[str]:
    output = seen.done.out + seen.done.err
    if "Traceback" in output:
        return [f"a traceback: {output[-600:]}"]
    faults = dict.fromkeys(v.fault for _, v in latched if v.fault is not None)
    unreported = [fault for fault in faults if not _is_reported(fault, output)]
    return [f"{fault} was not reported" for fault in unreported]


_OTHER_NAMES = {
    Fault.PENDANT_IDLE: ("safety-idle",),
    Fault.E_STOP: ("safety-stop",),
    Fault.CAN_SILENCE: ("puck-silent", "interface-down", "unacknowledged", "bus-off"),
}


def _is_reported(fault: Fault, output: str) -> bool:
    names = (fault.value, *_OTHER_NAMES.get(fault, ()))
    return any(_has_words(CATALOGUE[name].what, output) for name in names)


def _has_words(what: str, output: str) -> bool:
    """Return whether the output contains the longest fixed part of a message."""
    return max((words for words, *_ in Formatter().parse(what)), key=len) in output


def _driven_again(seen: Seen, latched: Sequence[tuple[int, GuardVerdict]]) -> list[str]:
    """Return whether torques were applied again after a verdict that idles."""
    idled = [ns for ns, v in latched if v.action is Action.IDLE]
    if not idled:
        return []
    begin_ns = min(idled) + 20 * MS
    again = [row for row in seen.scene.seen if row[0] > begin_ns and row[1] == "driven"]
    return [f"driven {(row[0] - begin_ns) / MS:.0f} ms after idle" for row in again[:1]]


def _not_ended(seen: Seen, latched: Sequence[tuple[int, GuardVerdict]]) -> list[str]:
    code = seen.done.code
    is_over = any(verdict.ends_session for _, verdict in latched)
    # The exit code differs after an abandoned tare or without the final one.
    is_expected = code in {3, 4} or (not is_over and code in {0, 5})
    is_at_the_end = code == 0 and "No tare at the end" in seen.done.out
    return [] if is_expected or is_at_the_end else [f"exit code {code}"]


def _kept_without_power(seen: Seen) -> list[str]:
    if seen.folder is None:
        return []
    bad = []
    for path in sorted((seen.folder / "trials").glob("T??.mcap")):
        modes = TrialReader(path).cycles().data["flags"] & SAFETY_MODE_MASK
        if (modes != SafetyMode.ACTIVE).any():
            bad.append(f"{path.stem} was kept without power")
    return bad


def pair_attacks() -> list[Attack]:
    """Return every pair."""
    return [_attack(pair) for pair in every_pair()]


def _attack(pair: Pair) -> Attack:
    def check(folder: Path) -> None:
        problems = problems_of(pair, write_config(folder), folder / "data")
        assert not problems, "; ".join(problems)

    return Attack(
        f"{pair.first}, then {pair.second}",
        f"{pair.delay_ms} ms later, {pair.phase}",
        "both are reported, the stricter reaction applies, no unpowered trial is kept",
        check,
        RunBy.CI if pair in EVERY_COMMIT else RunBy.NIGHTLY,
        seconds=240,
    )
