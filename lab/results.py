"""What a scenario comes to, as a line of JSON on the machine's serial console."""

import json
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

MARK = "@lab "  # before each line of JSON; everything else is the machine's own output


class Verdict(Enum):
    """How a scenario ended.

    EXPECTED: it fails for a reason that is known and written beside it. SURPRISING: it
    was expected to fail and passed, so its reason is out of date.
    """

    PASSED = "passed"
    FAILED = "failed"
    EXPECTED = "expected"
    SURPRISING = "surprising"
    HUNG = "hung"

    @property
    def is_fine(self) -> bool:
        """Whether the run as a whole may still succeed."""
        return self in {Verdict.PASSED, Verdict.EXPECTED}


@dataclass(frozen=True, slots=True)
class ScenarioResult:
    """How one scenario ended.

    Attributes:
        name: of the scenario.
        verdict: how it ended.
        seconds: guest time that it took [s].
        figures: what was measured, in words with units, by name.
        reason: why it is not simply passed.
        output: of the commands that it ran; kept where it failed.
        processor: time of the host that the emulation took [s], as the host adds it.
    """

    name: str
    verdict: Verdict
    seconds: float
    figures: dict[str, str] = field(default_factory=dict[str, str])
    reason: str = ""
    output: str = ""
    processor: float = 0.0


@dataclass(frozen=True, slots=True)
class Begun:
    """A scenario has begun; until its result comes, a hanging machine hangs in it."""

    name: str


@dataclass(frozen=True, slots=True)
class Finished:
    """The machine has run everything; `boot_seconds`: guest time until the first."""

    boot_seconds: float


@dataclass(frozen=True, slots=True)
class TimerFound:
    """Where the kernel keeps its local timer: values of two of its symbols.

    Attributes:
        events: `lapic_events`.
        offsets: `__per_cpu_offset`.
    """

    events: int
    offsets: int


Message = ScenarioResult | Begun | Finished | TimerFound


_PLAIN = {one.__name__: one for one in (Begun, Finished, TimerFound)}


def to_line(message: Message) -> str:
    """Return a message as one line of the console."""
    fields = asdict(message)
    if isinstance(message, ScenarioResult):
        fields["verdict"] = message.verdict.value
    return MARK + json.dumps({"kind": type(message).__name__, **fields})


def from_line(line: str) -> Message | None:
    """Return the message of a line, None where it is something else or is damaged."""
    # A kernel message may stand before the mark on the same line.
    _, mark, text = line.partition(MARK)
    if not mark:
        return None
    try:
        fields: dict[str, Any] = json.loads(text)
        kind = fields.pop("kind")
        if kind == ScenarioResult.__name__:
            return ScenarioResult(verdict=Verdict(fields.pop("verdict")), **fields)
        return _PLAIN[kind](**fields)
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
