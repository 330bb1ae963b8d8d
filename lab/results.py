"""Results of scenarios as lines of JSON on the machine's serial console."""

import json
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any

MARK = "@lab "  # prefix of each line of JSON; other lines are the machine's own output


class Verdict(Enum):
    """Outcome of a scenario.

    EXPECTED: it failed for the documented reason. SURPRISING: it passed although a
    failure is documented, so that reason is out of date.
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
    """Result of one scenario.

    Attributes:
        name: name of the scenario.
        verdict: its outcome.
        seconds: its duration in guest time [s].
        figures: measured values as text with units, by name.
        reason: explanation of any verdict but passed.
        output: output of its commands if it failed.
        processor: the host's processor time [s], added by the host.
    """

    name: str
    verdict: Verdict
    seconds: float
    figures: dict[str, str] = field(default_factory=dict[str, str])
    reason: str = ""
    output: str = ""
    processor: float = 0.0


@dataclass(frozen=True, slots=True)
class ScenarioStarted:
    """A scenario has begun; if no result follows, the machine hung in it."""

    name: str


@dataclass(frozen=True, slots=True)
class AllFinished:
    """All scenarios have run; `boot_seconds` is the guest time until the first [s]."""

    boot_seconds: float


@dataclass(frozen=True, slots=True)
class TimerLocation:
    """Location of the kernel's local timer: the values of two kernel symbols.

    Attributes:
        events: value of `lapic_events`.
        offsets: value of `__per_cpu_offset`.
    """

    events: int
    offsets: int


Message = ScenarioResult | ScenarioStarted | AllFinished | TimerLocation


_PLAIN = {kind.__name__: kind for kind in (ScenarioStarted, AllFinished, TimerLocation)}


def to_line(message: Message) -> str:
    """Return a message as one line of the console."""
    fields = asdict(message)
    if isinstance(message, ScenarioResult):
        fields["verdict"] = message.verdict.value
    return MARK + json.dumps({"kind": type(message).__name__, **fields})


def from_line(line: str) -> Message | None:
    """Return the message of a line, None if there is none or it is damaged."""
    # A kernel message may precede the mark on the same line.
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
