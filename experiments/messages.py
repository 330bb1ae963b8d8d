"""The message catalogue: what happened, what the arm does, what to do."""

import os
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from importlib import resources
from pathlib import Path
from string import Formatter

from acquisition.control_loop.faults import (
    CircuitCauses,
    Fault,
    GuardVerdict,
    LateReplies,
    ReplySilence,
)
from acquisition.control_loop.states import ArmState
from acquisition.cores import available_cores
from acquisition.devices import BusCondition, SafetyMode
from acquisition.errors import IDLE_ARM, PreflightError, UnfitDeviceError
from experiments.operator.keys import AFTER_FAULT
from experiments.operator.prompts import Prompt
from ft_sensor.weighing import WeightCause

RESUME = "traction resume"
REPORT = "traction report"


@dataclass(frozen=True, slots=True)
class Message:
    """One row of the catalogue; the parts are format strings.

    Attributes:
        what: what happened, with numbers and limits.
        do: what to do.
        exit_code: exit code of a command that ends with this message.
        more: explanation for `traction check --explain`.
        arm: state of the arm; empty if no arm is involved.
        example: example of a `what` supplied by a driver; else empty.
        prompt: prompt whose keys `do` names; else empty.
        blames_hardware: whether the error suggests a fault of cables or devices.
    """

    what: str
    do: str
    exit_code: int
    more: str
    arm: str = ""
    example: str = ""
    prompt: str = ""
    blames_hardware: bool = False

    def text(self, fields: Mapping[str, object], saved: str = "") -> str:
        """Return the message in one line."""
        arm = f"ARM: {self.arm}." if self.arm else ""
        parts = (self.what.format_map(fields), arm, self.do.format_map(fields), saved)
        return " ".join(part for part in parts if part)

    def sample(self) -> tuple[str, str]:
        """Return `what` and `do` with "…" for numbers and names."""
        do = self.do.replace("{then}", AFTER_FAULT[Prompt.READY])
        do = do.replace("{command}", RESUME)
        return _left_open(self.example or self.what), _left_open(do)


def _load() -> dict[str, Message]:
    text = (resources.files("experiments.data") / "messages.toml").read_text()
    return {name: Message(**row) for name, row in tomllib.loads(text).items()}


def _left_open(text: str) -> str:
    """Return a format string with "…" for its fields."""
    parts = Formatter().parse(text)
    return "".join(word + ("…" if name is not None else "") for word, name, *_ in parts)


CATALOGUE: Mapping[str, Message] = _load()


def preflight_error(name: str, **fields: object) -> PreflightError:
    """Return the preflight error called `name` in the catalogue."""
    message = CATALOGUE[name]
    kind = UnfitDeviceError if message.blames_hardware else PreflightError
    return kind(
        message.what.format_map(fields),
        hint=message.do.format_map(fields),
        arm_state=message.arm,
    )


def weight_words(cause: WeightCause, **fields: object) -> dict[str, str]:
    """Return fields of a message that explain a wrong weight of the foot.

    Args:
        cause: the probable cause.
        fields: foot, mass and `seen` mass [kg], turned [degrees], sign.
    """
    names = ("likely", "question", "remedy")
    parts = zip(names, _WEIGHT_WORDS[cause], strict=True)
    return {name: words.format_map(fields) for name, words in parts}


def explanation(name: str) -> list[str]:
    """Return the full explanation of the message `name`, line by line."""
    message = CATALOGUE[name]
    arm = [f"ARM: {message.arm}."] if message.arm else []
    what, do = message.sample()
    code = f"exit code {message.exit_code}"
    return [f"{name}: {what}", *arm, *([do] if do else []), message.more, code]


def catalogue_table(names: Sequence[str] = ()) -> list[str]:
    """Return the catalogue, or the rows `names`, as a Markdown table."""
    rows = ["| message | what you read | the arm | what to do |", "|---|---|---|---|"]
    for name in names or sorted(CATALOGUE):
        what, do = CATALOGUE[name].sample()
        rows.append(f"| `{name}` | {what} | {CATALOGUE[name].arm} | {do} |")
    return rows


# Messages of faults with a known cause; otherwise that of the fault.
_BY_MONITOR = {Fault.PENDANT_IDLE: "safety-idle", Fault.E_STOP: "safety-stop"}
_BY_CONDITION = {
    BusCondition.DOWN: "interface-down",
    BusCondition.FULL: "unacknowledged",
    BusCondition.OFF: "bus-off",
    BusCondition.UNACKNOWLEDGED: "unacknowledged",
}
BUS_WORDS = {  # conditions of a bus without communication
    BusCondition.DOWN: "The CAN interface refuses to send and receive.",
    BusCondition.FULL: "No device on the CAN bus acknowledges: its queue is full.",
    BusCondition.OFF: "The CAN controller has left the bus (bus-off).",
    BusCondition.UNACKNOWLEDGED: "No device on the CAN bus acknowledges.",
}
# Explanations of an unexpected weight of the foot: finding, question, remedy.
_WEIGHT_WORDS = {
    WeightCause.MASS: (
        "as if the foot weighed {seen:.3f} kg",
        "Is feet.{foot}.mass {mass:.3f} kg right?",
        "traction calibrate foot",
    ),
    WeightCause.SIGN: (
        "as if the sensor had the other sign",
        "Is ft_sensor.sign {sign:+z.0f} right (+1 reads the load, -1 the reaction)?",
        "traction calibrate sensor",
    ),
    WeightCause.TURNED: (
        "as if the sensor were turned by {turned:.0f} degrees about z",
        "Is ft_sensor.angle_deg right, and the sensor mounted as it was?",
        "traction calibrate sensor",
    ),
    WeightCause.UNKNOWN: (
        "which neither a mass, nor the other sign, nor a turned sensor explains",
        "Is feet.{foot}.mass {mass:.3f} kg right?",
        "traction calibrate foot",
    ),
}
_HEARTBEAT = "heartbeat"  # the monitor of the loop's traffic
_PUCKS = 7


@dataclass(frozen=True, slots=True)
class ComputerLoad:
    """Load of the computer.

    Attributes:
        load: number of running and waiting programs: mean of the last minute, or the
            present one if larger.
        cores: number of cores available to this program.
    """

    load: float
    cores: int

    @classmethod
    def now(cls) -> "ComputerLoad":
        """Return the load of this computer."""
        load = os.getloadavg()[0]
        with suppress(OSError):  # only Linux reports the present number
            words = Path("/proc/loadavg").read_text().split()
            load = max(load, int(words[3].partition("/")[0]))
        return cls(load, available_cores())

    @property
    def is_too_much(self) -> bool:
        """Whether programs wait for a core."""
        return self.load > self.cores

    def blamed(self, error: PreflightError) -> PreflightError:
        """Return the error with the busy computer as its first explanation."""
        message = CATALOGUE["too-busy"]
        fields = {**asdict(self), "what": error.message, "then": "then try again"}
        return PreflightError(
            message.what.format_map(fields),
            hint=message.do.format_map(fields),
            arm_state=error.arm_state,
        )


# Faults that an overloaded computer can cause.
_OF_TIME = {
    Fault.LOOP_LATE,
    Fault.LOOP_LOST,
    Fault.CONSOLE_SILENT,
    Fault.RECORDER_SILENT,
    Fault.FT_STALE,
    Fault.CAN_SILENCE,
    Fault.SAFETY_SILENT,
}


_UNKNOWN = "UNKNOWN - support it"
# (state of the arm in a message, state requested since, text for it)
_ARM_BY_NOW = (
    ("idle", ArmState.UNKNOWN, _UNKNOWN),
    ("damped", ArmState.IDLE, IDLE_ARM),
)


@dataclass(frozen=True, slots=True)
class FaultContext:
    """Context of a fault, for its message.

    Attributes:
        trial: name of the trial, or "The session".
        seconds: time since the start of the recording [s], None outside of one.
        bus: condition of the CAN bus.
        prompt: the following prompt; None = the session ends.
        command: command that continues the work after the end.
        load: load of a computer that simulates in real time; None = it does not, or
            faults were planned.
        state: state requested from the arm by now; None = as in the message.
    """

    trial: str = "The session"
    seconds: float | None = None
    bus: BusCondition = BusCondition.SOUND
    prompt: Prompt | None = Prompt.READY
    command: str = RESUME
    load: ComputerLoad | None = None
    state: ArmState | None = None


def fault_text(verdict: GuardVerdict, context: FaultContext, saved: str = "") -> str:
    """Return the message of a verdict."""
    message, values = _filled(verdict, context)
    return message.text(values, saved)


def fault_words(verdict: GuardVerdict) -> str:
    """Return one sentence on a fault other than the strictest."""
    message, values = _filled(verdict, FaultContext(prompt=None))
    return message.what.format_map(values)


def _filled(
    verdict: GuardVerdict, context: FaultContext
) -> tuple[Message, dict[str, object]]:
    """Return the message of a verdict, and its fields.

    A verdict of the safety circuit is attributed to the pendant unless a monitor caused
    it; silence to the bus, or to the silent pucks.
    """
    detail, causes = verdict.detail, ""
    is_of_time = verdict.fault in _OF_TIME
    name, nodes = verdict.reason, list[int]()
    if isinstance(detail, CircuitCauses):
        causes = ", ".join(f"{cause} fault" for cause in detail.tripped)
        is_of_time = is_of_time or _HEARTBEAT in detail.causes
        if causes and verdict.fault is not None:
            name = _BY_MONITOR[verdict.fault]
    elif isinstance(detail, ReplySilence):
        nodes = _nodes(detail.silent)
        if context.bus is not BusCondition.SOUND:
            name = _BY_CONDITION[context.bus]
        elif len(nodes) < _PUCKS:
            name = "puck-silent"
    elif isinstance(detail, LateReplies):
        nodes = _nodes(detail.motors)
    values: dict[str, object] = {
        "trial": context.trial,
        "seconds": context.seconds or 0.0,
        "when": "" if context.seconds is None else f" at {context.seconds:.2f} s",
        "pucks": _who(nodes),
        "then": AFTER_FAULT[context.prompt].format(command=context.command),
        "command": context.command,
    }
    values |= {**asdict(detail), "causes": causes}
    message = CATALOGUE[name]
    if context.load is not None and is_of_time:
        values |= {**asdict(context.load), "what": message.what.format_map(values)}
        message = replace(CATALOGUE["too-busy"], arm=message.arm)
    for text, state, arm in _ARM_BY_NOW:
        if context.state is state and message.arm.startswith(text):
            message = replace(message, arm=arm)
    return message, values


def rest_text(mode: SafetyMode, *, is_confirmed: bool) -> str:
    """Describe the state of the arm at the end, `is_confirmed` by the safety module."""
    if not is_confirmed:
        return f"ARM: {_UNKNOWN}."
    if mode is SafetyMode.E_STOP:
        return "ARM: stopped by its hardware, without power; it sinks, support it."
    return f"ARM: {IDLE_ARM}."


def pucks_have(silent: int) -> str:
    """Return e.g. "Pucks 2,3 have": those whose bits are set in `silent`."""
    return _who(_nodes(silent))


def _nodes(silent: int) -> list[int]:
    """Return the pucks whose bits are set."""
    return [node for node in range(1, _PUCKS + 1) if silent >> (node - 1) & 1]


def _who(nodes: list[int]) -> str:
    names = ",".join(map(str, nodes))
    return f"Puck {names} has" if len(nodes) == 1 else f"Pucks {names} have"
