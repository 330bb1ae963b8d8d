"""A session as an operator leads it: keys for the program, a hand for the arm."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from acquisition import PERIOD_NS
from acquisition.trial_file import TrialReader
from lab.guest.commands import Program, ScenarioError, require
from lab.guest.machine_room import MachineRoom

_START = 60.0  # s of guest time until the arm is to be activated
_STEP = 30.0  # s until the program goes on by itself
_REACTION = 0.3  # s from a prompt to the key
_REST = 0.7  # s in which the foot comes to rest on the ground
_PUSH = 1.0  # s of a trial, ended by key: every second costs the host many
TERRAIN = "TF"
MOST_MISSED_PPM = 10


@dataclass(frozen=True, slots=True)
class LedSession:
    """A running session and the arm it is on."""

    room: MachineRoom
    program: Program
    arm: Program

    def activate(self) -> None:
        """Support the arm and press the pendant."""
        self.program.expect("Press Shift-activate", _START)
        self._hand("lift", "activate")
        self._press(" ")

    def tare(self) -> None:
        """Lift the foot until the program has tared."""
        self.program.expect("Lift the foot", _STEP)
        self._hand("lift")

    def make_ready(self, number: int) -> None:
        """Lift the foot, put it down, wait until it rests."""
        self.tare()
        self.program.expect("[space] record", _STEP)
        self._hand(f"prepare {number}", "put_down")
        self.program.run_on(_REST)

    def record(self) -> None:
        """Begin to record, and to push."""
        self._press(" ")
        self._hand("push")

    def keep(self) -> None:
        """End the trial after a second, wait until it is on the disk, keep it."""
        self.program.run_on(_PUSH)
        self._press(" ")
        self.program.expect("written and verified", _STEP)
        self.program.expect("[k]eep", _STEP)
        self._hand("rest")
        self._press("k")

    def trial(self, number: int) -> None:
        """Record one trial and keep it."""
        self.make_ready(number)
        self.record()
        self.keep()

    def end(self, code: int = 0) -> None:
        """Wait for the end of the last tare and of the program."""
        self.tare()
        self.room.finish(self.program, _STEP, code)

    def pause(self) -> None:
        """Let the arm hold for a second, then go on; a trial is ready before."""
        self._press("p")
        self.program.expect("Paused.", _STEP)
        self.program.run_on(_REACTION)
        self._press(" ")
        self.program.expect("[space] record", _STEP)

    def _press(self, key: str) -> None:
        """Press a key as a person does: what comes before a prompt is forgotten."""
        self.program.run_on(_REACTION)
        self.program.press(key)

    def _hand(self, *actions: str) -> None:
        for action in actions:
            self.arm.press(f"{action}\n")


def begin(room: MachineRoom, arm: Program, trials: int, *options: str) -> LedSession:
    """Return a session of `trials` trials up to the activated arm."""
    program = room.traction("run", TERRAIN, "--trials", str(trials), *options)
    session = LedSession(room, program, arm)
    session.activate()
    return session


def resume(room: MachineRoom, arm: Program) -> LedSession:
    """Return the unfinished session, opened again, up to the activated arm."""
    session = LedSession(room, room.traction("resume"), arm)
    session.activate()
    return session


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
