"""A session as an operator leads it: keys for the program, a hand for the arm."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from acquisition.clock import PERIOD_NS
from acquisition.trial_file.reader import TrialReader
from lab.guest.commands import Program, ScenarioError, require, seconds
from lab.guest.commissioned import take_as_commissioned
from lab.guest.machine_room import MachineRoom

_START = 60.0  # s of guest time until the arm is to be activated
_STEP = 30.0  # s until the program goes on by itself
_REVIEW = 90.0  # s until a trial is reviewed: what that needs is read from the host
_REACTION = 0.1  # s from a prompt to the key
_SUPPORT, _IDLE = "Support the arm: it goes idle", "i"
_REST = 0.7  # s in which the foot comes to rest on the ground
# s of a trial: each costs the host many; sooner the key that ends it counts as held.
_PUSH = 0.8
TERRAIN = "TF"
MOST_MISSED_PPM = 10


@dataclass(frozen=True, slots=True)
class LedSession:
    """A running session and the arm it is on."""

    room: MachineRoom
    program: Program
    arm: Program

    def wait_idle(self) -> None:
        """Wait until the arm is to be activated."""
        self.program.expect("Press Shift-activate", _START)

    def tare(self) -> None:
        """Activate the arm; lift the foot, which is tared then."""
        self.wait_idle()
        self.activate()
        self.lift()

    def activate(self) -> None:
        """Support the arm, press the pendant, confirm it."""
        self.hand("lift")
        self.program.run_on(_REACTION)  # an arm that is held is silent for no cycle
        self.hand("activate")
        self._press(" ")

    def lift(self) -> None:
        """Lift the foot as asked; it is tared while it is still."""
        self.program.expect("Lift the foot", _STEP)
        self.hand("lift")

    def await_ready(self) -> None:
        """Activate the arm and wait until a trial can be recorded."""
        self.tare()
        self.program.expect("[space] record", _STEP)

    def put_down(self, number: int) -> None:
        """Put the foot down on the ground of trial `number`, once it is tared."""
        self.hand(f"prepare {number}", "put_down")
        self.program.run_on(_REST)

    def start_trial(self, number: int = 1) -> None:
        """Put the foot down, begin to record and to push."""
        self.put_down(number)
        self._press(" ")
        self.hand("push")

    def record(self, number: int = 1) -> None:
        """Put the foot down, begin to record, push for a while."""
        self.start_trial(number)
        self.program.run_on(_PUSH)

    def review(self) -> None:
        """End the trial, wait until it is on the disk and to be judged."""
        self._press(" ")
        self.program.expect("written and verified", _REVIEW)
        self.program.expect("[k]eep", _STEP)
        self.hand("rest")

    def keep(self) -> None:
        """Review the trial and keep it; the foot is to be lifted next."""
        self.review()
        self._press("k")
        self.lift()

    def another(self) -> None:
        """Wait until the next trial can be recorded."""
        self.program.expect("[space] record", _STEP)

    def cut_off(self) -> int:
        """Return the exit code of a session that was cut, once it has ended.

        An arm that still holds then is supported before it goes idle, as asked.
        """
        end = seconds() + _STEP
        while self.program.is_running and seconds() < end:
            self.program.run_on(_REACTION)
            if _SUPPORT in self.program.output:
                self._press(_IDLE)
                break
        return self.program.wait(_STEP)

    def leave(self) -> None:
        """Leave the session to be resumed another time."""
        self._press("q")

    def confirm(self) -> None:
        """Press the space bar, as asked."""
        self._press(" ")

    def _press(self, key: str) -> None:
        """Press a key as a person does: what comes before a prompt is forgotten."""
        self.program.run_on(_REACTION)
        self.program.press(key)

    def hand(self, *actions: str) -> None:
        """Let the person at the arm act."""
        for action in actions:
            self.arm.press(f"{action}\n")


def begin(room: MachineRoom, arm: Program, trials: int, *options: str) -> LedSession:
    """Return a session of `trials` trials, before its preflight."""
    take_as_commissioned(room.config)
    program = room.traction("run", TERRAIN, "--trials", str(trials), *options)
    return LedSession(room, program, arm)


def resume(room: MachineRoom, arm: Program) -> LedSession:
    """Return the unfinished session, opened again; whoever cut it has mended it."""
    arm.press("mend\n")
    arm.press("idle\n")
    return LedSession(room, room.traction("resume"), arm)


def session_folder(room: MachineRoom) -> Path:
    """Return the folder of the scenario's one session."""
    folders = [path for path in (room.data / "sessions").iterdir() if path.is_dir()]
    if len(folders) != 1:
        raise ScenarioError(f"{len(folders)} sessions in place of one")
    return folders[0]


def verify_kept(room: MachineRoom, wanted: int) -> list[Path]:
    """Return the kept trials' files, each accepted by `traction verify`."""
    folder = session_folder(room)
    kept = sorted((folder / "trials").glob("T??.mcap"))
    require(len(kept) == wanted, f"{len(kept)} trials kept in place of {wanted}")
    room.finish(room.start_plain("verify", str(folder)), _STEP)
    return kept


def require_rejected(room: MachineRoom, wanted: int) -> int:
    """Return how many attempts were put away.

    Raises:
        ScenarioError: it is not `wanted`.
    """
    count = len(list((session_folder(room) / "rejected").glob("T???.mcap")))
    require(count == wanted, f"{count} attempts put away in place of {wanted}")
    return count


def cycle_figures(room: MachineRoom) -> dict[str, str]:
    """Return cycles, missed ones and the worst gap of the kept trials.

    Raises:
        ScenarioError: more than 10 ppm of the cycles were missed.
    """
    cycles = missed = 0
    worst = 0
    for path in sorted((session_folder(room) / "trials").glob("T??.mcap")):
        times = TrialReader(path).cycles().data["host_ns"].tolist()
        steps = [b - a for a, b in pairwise(times)]
        cycles += len(times)
        missed += sum(round(step / PERIOD_NS) - 1 for step in steps)
        worst = max(worst, *steps)
    require(missed * 1_000_000 <= MOST_MISSED_PPM * cycles, f"{missed} cycles missed")
    return {
        "cycles": str(cycles),
        "missed": str(missed),
        "gap": f"{worst / 1e6:.2f} ms",
    }
