"""May torque be sent to this arm? What is missing, wrong or stale in its record."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta

from acquisition.errors import PreflightError
from experiments.commissioning.record import Commissioning
from experiments.commissioning.steps import (
    BASES,
    GATED,
    LONGEST_DAYS,
    ORDER,
    ProofStep,
)
from experiments.dates import is_ahead

FIELD = "commissioning"  # of the metadata of a recording
COMPLETE = "complete"  # what it says of an arm that lacks nothing


@dataclass(frozen=True, slots=True)
class Lack:
    """A step that does not count.

    Attributes:
        step: which.
        cause: why, in words.
        subject: with what of several, e.g. a terrain; "" = there is one only.
    """

    step: ProofStep
    cause: str
    subject: str = ""

    @property
    def text(self) -> str:
        """Return it in one line."""
        of = f" of {self.subject}" if self.subject else ""
        return f"{self.step} {self.step.words}{of}: {self.cause}"


def bases_of(step: ProofStep) -> list[str]:
    """Return the names of what a step stands on."""
    return [name for name, basis in BASES.items() if step in basis.steps]


def lacks(
    record: Commissioning | None,
    inputs: Mapping[str, str],
    now: datetime,
    terrain: str = "",
) -> list[Lack]:
    """Return every step that does not count, in order; `()` = all of them do.

    Args:
        record: what was done; None = nothing was.
        inputs: digests of what steps stand on, as it is now; what is not known now is
            no contradiction.
        now: UTC.
        terrain: whose container is meant; "" = the one that was looked at last.
    """
    return [
        Lack(step, cause, subject)
        for step in ORDER
        for subject in [terrain if step is ProofStep.CONTAINER else ""]
        if (cause := _cause(record, step, subject, inputs, now))
    ]


def _cause(
    record: Commissioning | None,
    step: ProofStep,
    subject: str,
    inputs: Mapping[str, str],
    now: datetime,
) -> str:
    done = record.of(step, subject) if record is not None else None
    if record is None or done is None:
        return "not done"
    if done.verdict == "wrong":
        return done.cause or "failed"
    inputs = {**inputs, **record.told_inputs()}
    for name in bases_of(step):
        then, current = done.inputs.get(name), inputs.get(name)
        if then is None and BASES[name].may_be_untold:
            continue
        if current is not None and then != current:
            when = record.told.get(name)
            told = "" if when is None else f" on {when:%Y-%m-%d}, as told"
            return f"stale: {BASES[name].words} changed{told}"
    if now - done.ended > timedelta(days=LONGEST_DAYS):
        return f"stale: done more than {LONGEST_DAYS} days ago"
    if is_ahead(done.ended, now):
        return f"done on {done.ended:%Y-%m-%d %H:%M} UTC, which has not come yet"
    return ""


def require(found: list[Lack]) -> None:
    """Refuse to send torque where a step that it needs does not count.

    Raises:
        PreflightError: C0 to C11 are not all there, sound and not stale.
    """
    gated = [lack for lack in found if lack.step in GATED]
    if not gated:
        return
    first, more = gated[0], len(gated) - 1
    others = f", and {more} more" if more else ""
    raise PreflightError(
        f"This arm is not commissioned: {first.text}{others}.",
        hint=f"traction commission --from {first.step}",
        arm_state="not touched",
    )
