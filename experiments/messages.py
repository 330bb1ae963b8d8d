"""The message catalogue: what happened, what the arm does, what to do."""

from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.devices import SafetyMode
from acquisition.guard import Verdict


@dataclass(frozen=True, slots=True)
class Message:
    """One row of the catalogue; the parts are format strings.

    Attributes:
        what: what happened, with numbers and limits.
        arm: what the arm is doing now; empty where no arm is involved.
        do: what to do.
        exit_code: of the command, when it ends with this message.
        more: explanation for `traction check --explain`.
    """

    what: str
    arm: str
    do: str
    exit_code: int
    more: str

    def text(self, facts: Mapping[str, object], saved: str = "") -> str:
        """Return the message in one line."""
        arm = f"ARM: {self.arm}." if self.arm else ""
        parts = (self.what.format_map(facts), arm, self.do.format_map(facts), saved)
        return " ".join(part for part in parts if part)


CATALOGUE: dict[str, Message] = {
    "can-down": Message(
        "The CAN interface cannot be used: {detail}",
        "not touched",
        "Fix: ip link set can0 up type can bitrate 1000000.",
        3,
        "The adapter is missing, its interface is down or another bit rate is set.",
    ),
    "puck-missing": Message(
        "{detail}",
        "not touched",
        "Check its cable or a puck in reset.",
        3,
        "Every motor controller answers within a millisecond; one that is silent is "
        "unplugged, without power or in reset.",
    ),
    "not-zeroed": Message(
        "The arm is not zeroed.",
        "idle",
        "Move it to the home position, press Shift-idle, then run: traction zero",
        3,
        "After power-up the motor controllers do not know where the joints are.",
    ),
    "not-active": Message(
        "The arm was not activated within {seconds:.0f} s.",
        "idle",
        "Press Shift-activate on the pendant when asked to.",
        3,
        "Only the pendant can activate the arm; the program waits for it.",
    ),
    "ft-silent": Message(
        "{detail}",
        "idle",
        "Check power and cable.",
        3,
        "The serial port opens, but the force/torque sensor sends nothing.",
    ),
    "ft-stale": Message(
        "{trial} stopped at {seconds:.1f} s: F/T sample {ms:.0f} ms old "
        "(limit {limit:.0f}).",
        "holding",
        "[r]edo when the sensor is back.",
        4,
        "A trial without force samples is worth nothing, so it is stopped at once.",
    ),
    "loop-late": Message(
        "{late:.0f} late cycles in 1 s (limit {limit:.0f}). Likely: governor "
        "powersave, or another process on the core.",
        "holding",
        "Close other programs, then [r]edo.",
        4,
        "The loop has 2 ms per cycle; a machine that is busy elsewhere takes them.",
    ),
    "console-silent": Message(
        "The console did not look after the arm for 0.5 s.",
        "holding",
        "Close what else keeps this computer busy, then [r]edo.",
        4,
        "The loop watches the console's heartbeat; without it nobody could stop a "
        "trial, so the arm holds until the console is back.",
    ),
    "console-lost": Message(
        "The console's process has died.",
        "holding for 1 s, then idle",
        "Start again; a .partial file: traction recover.",
        4,
        "The process that has the arm outlives the console long enough to brake it.",
    ),
    "recorder-silent": Message(
        "{trial} stopped{when}: the recorder was silent for 0.5 s. Is the disk slow?",
        "holding",
        "Check the disk, then [r]edo.",
        4,
        "A trial that nobody writes down is worth nothing, so it is stopped.",
    ),
    "move-refused": Message(
        "The arm was asked to move where it cannot.",
        "holding",
        "Begin again from a pose inside the joint stops.",
        4,
        "Moves begin in hold only and end within the joint stops.",
    ),
    "exchange": Message(
        "{lost} of {cycles} exchanges with the arm were incomplete.",
        "idle",
        "Check cable and termination, or use another CAN adapter.",
        3,
        "Before a session the positions are asked for 100 times without torque.",
    ),
    "loop-dead": Message(
        "The loop does not run.",
        "idle",
        "Start again; if it happens twice, report it.",
        3,
        "The process that has the arm started, but no cycle was seen.",
    ),
    "overspeed": Message(
        "Joint {joint:.0f} {value:.2f} rad/s > {limit:.2f}.",
        "damping, then holding",
        "Push more slowly, then [r]edo.",
        4,
        "Speed limits keep people safe; slips on stones stay far below them.",
    ),
    "foot-speed": Message(
        "The foot moved at {value:.2f} m/s > {limit:.2f}.",
        "damping, then holding",
        "Push more slowly, then [r]edo.",
        4,
        "Slips on stones reach 0.4 m/s; more than the limit is no slip.",
    ),
    "joint-limit": Message(
        "Joint {joint:.0f} at {value:.2f} rad is beyond {limit:.2f}.",
        "damping, then holding",
        "Move it back inside by hand, then [r]edo.",
        4,
        "The limit is armed once the joint has been 0.1 rad inside it.",
    ),
    "torque-limit": Message(
        "Joint {joint:.0f} was asked for {value:.1f} N m > {limit:.1f}.",
        "damping, then holding",
        "Check the foot's mass in rig.toml and the pose, then [r]edo.",
        4,
        "Normal trials stay below half of the torque limits.",
    ),
    "joint7-slip": Message(
        "Joint 7 moved {mrad:.0f} mrad (limit {limit:.0f}).",
        "holding",
        "Check the foot's mount, then [r]edo.",
        4,
        "Joint 7 is locked so that the foot does not turn below the sensor.",
    ),
    "can-silence": Message(
        "No reply from the arm for {ms:.0f} ms.",
        "UNKNOWN - support it, press Shift-idle",
        "Check the CAN cable, then: traction check.",
        4,
        "Without positions there is no gravity compensation to trust.",
    ),
    "puck-silent": Message(
        "{pucks} not answered for {ms:.0f} ms; the others do.",
        "held by its last torques, being braked - support it",
        "Check the puck's cable. If it was in reset the arm has to be zeroed: traction "
        "check.",
        4,
        "The program goes on without a reply for five cycles. A puck that restarts on "
        "its own stays silent until a start-up wakes it, and has lost its position.",
    ),
    "bus-off": Message(
        "The CAN interface refuses to send and receive; no reply from the arm for "
        "{ms:.0f} ms.",
        "UNKNOWN - support it, press Shift-idle",
        "Check cable and terminators, restart the interface (ip link set can0 down, "
        "then up), then: traction check.",
        4,
        "A controller with too many errors leaves the bus. Without the loop's traffic "
        "the safety module brakes the arm by itself within 0.1 s.",
    ),
    "not-a-number": Message(
        "A position or torque was not a number.",
        "idle",
        "Keep the flight record and report it.",
        4,
        "Nothing that is not finite is ever sent to a motor.",
    ),
    "estop": Message(
        "Stop pressed{when}.",
        "stopped by its hardware",
        "Release it, press Shift-idle, zero the arm, then: traction resume.",
        4,
        "The hardware stop takes the power away; positions have to be defined anew.",
    ),
    "pendant-idle": Message(
        "The pendant or the safety module put the arm to idle{when}.",
        "idle, braked",
        "Look at the pendant's lamps, then: traction resume.",
        4,
        "Shift-idle was pressed or a safety limit was exceeded.",
    ),
    "safety-idle": Message(
        "The safety module put the arm to idle: {causes}.",
        "idle, braked",
        "Press Shift-idle to clear it, then: traction resume.",
        4,
        "The module supervises speed, commanded torque, bus voltage and the traffic of "
        "the loop; its limits are in [safety] of rig.toml.",
    ),
    "safety-stop": Message(
        "The safety module stopped the arm: {causes}.",
        "stopped by its hardware",
        "Check the arm's power supply, press Shift-idle, zero the arm, then: traction "
        "resume.",
        4,
        "A voltage fault, or a speed above the limit for half a second, takes the "
        "power away; positions have to be defined anew.",
    ),
    "tare-moved": Message(
        "Force varied {spread:.1f} N during tare (0.2 s means, limit {limit:.1f}).",
        "holding",
        "Is the foot touching? Lift it clear and keep it still.",
        3,
        "A tare taken while the foot moves would shift every force of the trial.",
    ),
    "disk-full": Message(
        "{free:.1f} GB free, a session needs {need:.1f} GB, minimum {limit:.0f} GB.",
        "not touched",
        "Make room, or name another folder with --data.",
        3,
        "A full disk would end a trial in the middle.",
    ),
    "write-failed": Message(
        "{trial} could not be verified: {detail}",
        "holding",
        "Kept as .partial: traction recover {path}",
        6,
        "Every file is read back before it counts.",
    ),
    "locked": Message(
        "{session} is open in process {pid} since {since} UTC.",
        "",
        "To watch: traction status --follow",
        2,
        "One process at a time writes into a session. When it dies, its lock is open.",
    ),
    "mismatch": Message(
        "Unfinished session {session} is {terrain}, you asked for {asked}.",
        "",
        "[1] resume {terrain}  [2] close it and start {asked}",
        2,
        "Terrains stand in the room one at a time, so the one that is there is "
        "finished first. A closed session keeps its trials.",
    ),
    "crash": Message(
        "{session} ended without closing ({where}). {kept} kept.",
        "",
        "[r]esume{redone}  [n]ew: close it and start another",
        2,
        "Every event is on the disk before the next one begins. A trial without a "
        "verdict is saved as far as it goes and recorded again.",
    ),
    "unfinished": Message(
        "{session} {terrain} is unfinished, {kept} of {wanted} kept.",
        "",
        "[r]esume  [n]ew: close it and start another",
        2,
        "A session is unfinished until all its trials are kept or it is closed.",
    ),
    "interrupted": Message(
        "Interrupted.",
        "holding, then idle",
        "Nothing that was recorded is lost.",
        5,
        "Ctrl-C ends a session on purpose, after closing the running trial.",
    ),
}

_BY_CAUSE = {"pendant-idle": "safety-idle", "estop": "safety-stop"}
_BUTTON = "other"  # the monitor that a pressed E-stop button shows
_PUCKS = 7


@dataclass(frozen=True, slots=True)
class Circumstances:
    """When and where a fault came.

    Attributes:
        trial: name of the trial, or "The session".
        seconds: since the start of the recording [s], None outside of one.
        is_bus_down: the CAN interface refuses to work.
    """

    trial: str = "The session"
    seconds: float | None = None
    is_bus_down: bool = False


def fault_text(verdict: Verdict, found: Circumstances, saved: str = "") -> str:
    """Return the message of a verdict.

    A verdict of the safety circuit is the pendant's unless a monitor is its cause;
    silence is the bus's, or that of the pucks that are silent.
    """
    words = [f"{c} fault" for c in verdict.causes if c != _BUTTON]
    name = _BY_CAUSE.get(verdict.reason, verdict.reason) if words else verdict.reason
    facts = dict(verdict.facts)
    silent = _nodes(int(facts.get("silent", 0)))
    if name == "can-silence" and found.is_bus_down:
        name = "bus-off"
    elif name == "can-silence" and len(silent) < _PUCKS:
        name = "puck-silent"
    known: dict[str, object] = {
        "trial": found.trial,
        "seconds": found.seconds or 0.0,
        "when": "" if found.seconds is None else f" at {found.seconds:.2f} s",
        "pucks": _who(silent),
        "causes": ", ".join(words),
    }
    return CATALOGUE[name].text({**known, **facts}, saved)


def rest_text(mode: SafetyMode, *, is_confirmed: bool) -> str:
    """Return what the arm does at the end, `is_confirmed` by the safety module."""
    if not is_confirmed:
        return "ARM: UNKNOWN - support it."
    if mode is SafetyMode.E_STOP:
        return "ARM: stopped by its hardware, without power."
    return "ARM: idle, braked."


def _nodes(silent: int) -> list[int]:
    """Return the pucks whose bits are set."""
    return [node for node in range(1, _PUCKS + 1) if silent >> (node - 1) & 1]


def _who(nodes: list[int]) -> str:
    names = ",".join(map(str, nodes))
    return f"Puck {names} has" if len(nodes) == 1 else f"Pucks {names} have"
