"""An operator's session: keys to the program, commands to the hand on the arm."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from acquisition.clock import PERIOD_NS
from acquisition.trial_file.reader import TrialReader
from lab.guest.commands import Program, ScenarioError, require, seconds
from lab.guest.commissioned import write_passed_commissioning
from lab.guest.machine_room import MachineRoom

_START = 60.0  # s of guest time until the prompt to activate the arm
_STEP = 30.0  # s until the next prompt
_REVIEW = 90.0  # s until a trial's review, whose modules are read from the host
_REACTION = 0.1  # s from a prompt to the key
_SUPPORT, _IDLE = "Support the arm: it goes idle", "i"
_REST = 0.7  # s in which the foot comes to rest on the ground
# Duration of a trial [s]: short, as it takes the host far longer; but any sooner the
# key that ends it would count as held down.
_PUSH = 0.8
TERRAIN = "TF"
MAX_MISSED_PPM = 10


@dataclass(frozen=True, slots=True)
class LedSession:
    """A running session and its arm."""

    room: MachineRoom
    program: Program
    arm: Program

    def wait_idle(self) -> None:
        """Wait for the prompt to activate the arm."""
        self.program.expect("Press Shift-activate", _START)

    def tare(self) -> None:
        """Activate the arm and lift the foot for the tare."""
        self.wait_idle()
        self.activate()
        self.lift()

    def activate(self) -> None:
        """Support the arm, press the pendant and confirm."""
        self.hand("lift")
        self.program.run_on(_REACTION)  # the hand must hold the arm before it is active
        self.hand("activate")
        self._press(" ")

    def lift(self) -> None:
        """Lift the foot when prompted; it is tared while still."""
        self.program.expect("Lift the foot", _STEP)
        self.hand("lift")

    def await_ready(self) -> None:
        """Activate the arm and wait until a trial can be recorded."""
        self.tare()
        self.program.expect("[space] record", _STEP)

    def put_down(self, number: int) -> None:
        """Put the tared foot down on the ground of trial `number`."""
        self.hand(f"prepare {number}", "put_down")
        self.program.run_on(_REST)

    def start_trial(self, number: int = 1) -> None:
        """Put the foot down, start recording and pushing."""
        self.put_down(number)
        self._press(" ")
        self.hand("push")

    def record(self, number: int = 1) -> None:
        """Put the foot down, start recording, push for a while."""
        self.start_trial(number)
        self.program.run_on(_PUSH)

    def review(self) -> None:
        """End the trial; wait until it is written and can be reviewed."""
        self._press(" ")
        self.program.expect("written and verified", _REVIEW)
        self.program.expect("[k]eep", _STEP)
        self.hand("rest")

    def keep(self) -> None:
        """Review and keep the trial, then lift the foot."""
        self.review()
        self._press("k")
        self.lift()

    def another(self) -> None:
        """Wait until the next trial can be recorded."""
        self.program.expect("[space] record", _STEP)

    def cut_off(self) -> int:
        """Wait for the end of an interrupted session; return its exit code.

        If prompted, confirm that the arm is supported before it goes idle.
        """
        end = seconds() + _STEP
        while self.program.is_running and seconds() < end:
            self.program.run_on(_REACTION)
            if _SUPPORT in self.program.output:
                self._press(_IDLE)
                break
        return self.program.wait(_STEP)

    def leave(self) -> None:
        """Quit the session, to be resumed later."""
        self._press("q")

    def confirm(self) -> None:
        """Press the space bar."""
        self._press(" ")

    def _press(self, key: str) -> None:
        """Press a key after a reaction time: keys before a prompt are discarded."""
        self.program.run_on(_REACTION)
        self.program.press(key)

    def hand(self, *actions: str) -> None:
        """Send commands to the operator at the arm."""
        for action in actions:
            self.arm.press(f"{action}\n")


def begin(room: MachineRoom, arm: Program, trials: int, *options: str) -> LedSession:
    """Start a session of `trials` trials."""
    write_passed_commissioning(room.config)
    program = room.traction("run", TERRAIN, "--trials", str(trials), *options)
    return LedSession(room, program, arm)


def resume(room: MachineRoom, arm: Program) -> LedSession:
    """Clear the arm's faults and resume the unfinished session."""
    arm.press("mend\n")
    arm.press("idle\n")
    return LedSession(room, room.traction("resume"), arm)


def session_folder(room: MachineRoom) -> Path:
    """Return the folder of the scenario's one session."""
    folders = [path for path in (room.data / "sessions").iterdir() if path.is_dir()]
    if len(folders) != 1:
        raise ScenarioError(f"{len(folders)} sessions instead of one")
    return folders[0]


def verify_kept(room: MachineRoom, expected: int) -> list[Path]:
    """Check the kept trials with `traction verify`; return their files.

    Raises:
        ScenarioError: there are not `expected` trials, or one is damaged.
    """
    folder = session_folder(room)
    kept = sorted((folder / "trials").glob("T??.mcap"))
    require(len(kept) == expected, f"{len(kept)} trials kept instead of {expected}")
    room.finish(room.start_plain("verify", str(folder)), _STEP)
    return kept


def require_rejected(room: MachineRoom, expected: int) -> int:
    """Return the number of rejected attempts.

    Raises:
        ScenarioError: it is not `expected`.
    """
    count = len(list((session_folder(room) / "rejected").glob("T???.mcap")))
    require(count == expected, f"{count} rejected attempts instead of {expected}")
    return count


def cycle_figures(room: MachineRoom) -> dict[str, str]:
    """Return number of cycles, missed cycles and largest gap of the kept trials.

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
    require(missed * 1_000_000 <= MAX_MISSED_PPM * cycles, f"{missed} cycles missed")
    return {
        "cycles": str(cycles),
        "missed": str(missed),
        "gap": f"{worst / 1e6:.2f} ms",
    }
