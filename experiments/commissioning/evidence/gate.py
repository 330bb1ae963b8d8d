"""Decision whether torque may be sent: missing, failed and stale steps."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from acquisition.errors import IDLE_ARM, PreflightError, TractionError
from experiments.commissioning.evidence.daily_record import COUNTS_FOR, read_history
from experiments.commissioning.evidence.daily_record import FIELD as DAILY_FIELD
from experiments.commissioning.evidence.inputs import current_inputs
from experiments.commissioning.evidence.order import (
    GATED,
    LONGEST_DAYS,
    ORDER,
    STEP_INPUTS,
    StepId,
    input_names_of,
)
from experiments.commissioning.evidence.record import (
    COMPLETE,
    FIELD,
    Commissioning,
    read_commissioning,
)
from experiments.dates import is_ahead, is_fresh
from experiments.messages import preflight_error
from experiments.operator.console import BAD, GOOD, WARNING, AddLine
from experiments.rig.requests import LastAnswers
from experiments.rig.rig import Rig
from wam.driver.startup import ArmInfo


@dataclass(frozen=True, slots=True)
class Lack:
    """A step that is not valid.

    Attributes:
        step: the step.
        cause: the reason.
        subject: one of several, e.g. a terrain; "" = there is only one.
    """

    step: StepId
    cause: str
    subject: str = ""

    @property
    def text(self) -> str:
        """Return the lack in one line."""
        of = f" of {self.subject}" if self.subject else ""
        return f"{self.step} {self.step.words}{of}: {self.cause}"


def lacks(
    record: Commissioning | None,
    inputs: Mapping[str, str],
    now: datetime,
    terrain: str = "",
) -> list[Lack]:
    """Return every step that is not valid, in order; [] = all are valid.

    Args:
        record: the commissioning; None = none was done.
        inputs: present digests of the inputs of steps; an input unknown now is no
            contradiction.
        now: UTC.
        terrain: terrain of the container; "" = that of the last container.
    """
    return [
        Lack(step, cause, subject)
        for step in ORDER
        for subject in [terrain if step is StepId.CONTAINER else ""]
        if (cause := _cause(record, step, subject, inputs, now))
    ]


def _cause(
    record: Commissioning | None,
    step: StepId,
    subject: str,
    inputs: Mapping[str, str],
    now: datetime,
) -> str:
    done = record.of(step, subject) if record is not None else None
    if record is None or done is None:
        return "not done"
    if done.verdict == "wrong":
        return done.cause or "failed"
    inputs = {**inputs, **record.reported_inputs()}
    for name in input_names_of(step):
        then, current = done.inputs.get(name), inputs.get(name)
        if then is None and STEP_INPUTS[name].is_optional:
            continue
        if current is not None and then != current:
            when = record.told.get(name)
            reported = "" if when is None else f" on {when:%Y-%m-%d}, as told"
            return f"stale: {STEP_INPUTS[name].words} changed{reported}"
    if now - done.ended > timedelta(days=LONGEST_DAYS):
        return f"stale: done more than {LONGEST_DAYS} days ago"
    if is_ahead(done.ended, now):
        return f"done on {done.ended:%Y-%m-%d %H:%M} UTC, in the future"
    return ""


def require(found: list[Lack]) -> None:
    """Refuse to send torque unless all required steps are valid.

    Raises:
        PreflightError: C0 to C11 are not all done, sound and up to date.
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


def check_commissioned(
    rig: Rig,
    info: ArmInfo,
    add: AddLine,
    made_anew: Collection[str] = (),
    sensor: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Refuse torque for an arm that is not commissioned; returns metadata.

    Args:
        rig: a real rig, started, its loop not running.
        info: result of the start.
        add: receives the lines of the page.
        made_anew: names of `order.STEP_INPUTS` that the command measures again.
        sensor: identity of the wrist sensor; None = not read.

    Raises:
        PreflightError: a required step is missing, failed or stale.
    """
    now = datetime.fromtimestamp(rig.clock.utc_ns() // 1_000_000_000, UTC)
    try:
        record = read_commissioning(rig.settings.folder)
        if record is not None and record.is_simulated:
            record = None  # not of a real arm
        answers = rig.backend.ask(LastAnswers())
        present = current_inputs(rig, answers, info, sensor)
        inputs = {
            name: digest for name, digest in present.items() if name not in made_anew
        }
        missing = lacks(record, inputs, now, rig.row.name)
        require(missing)
    except TractionError as error:
        add(BAD, FIELD, error.message)
        raise PreflightError(
            error.message, hint=error.hint, arm_state=IDLE_ARM
        ) from error
    daily_text = _check_daily(rig, record, now, add)
    further = [lack.text for lack in missing if lack.step not in GATED]
    if further:
        text = f"uncommissioned: {'; '.join(further)}"
        add(WARNING, FIELD, text)
        return {FIELD: text, DAILY_FIELD: daily_text}
    add(GOOD, FIELD, "all steps, sound and not stale")
    return {FIELD: COMPLETE, DAILY_FIELD: daily_text}


def _check_daily(
    rig: Rig, record: Commissioning | None, now: datetime, add: AddLine
) -> str:
    """Refuse an arm whose last daily check failed; returns metadata.

    A missing check today is only a warning; on the day of the commissioning none is
    needed.

    Raises:
        PreflightError: the last daily check failed, or its date is in the future.
    """
    try:
        history = read_history(rig.settings.folder, is_simulated=False)
    except TractionError as error:
        add(BAD, "daily check", error.message)
        raise PreflightError(
            error.message, hint=error.hint, arm_state=IDLE_ARM
        ) from error
    ramps = record.of(StepId.RAMPS) if record is not None else None
    commissioned = ramps.ended if ramps is not None else None
    last = history.checks[-1] if history.checks else None
    if last is not None and (commissioned is None or last.ended > commissioned):
        if last.cause:
            add(BAD, "daily check", last.words)
            raise PreflightError(
                f"The daily check of this arm failed: {last.words}",
                hint="Look at what it names, then traction commission --daily.",
                arm_state=IDLE_ARM,
            )
        if is_ahead(last.ended, now):
            refusal = preflight_error("daily-ahead", ended=last.ended, now=now)
            add(BAD, "daily check", refusal.message)
            raise refusal
        if history.counts_at(now):
            add(GOOD, "daily check", last.words)
            return last.words
    elif commissioned is not None and is_fresh(commissioned, now, COUNTS_FOR):
        add(GOOD, "daily check", "commissioned today")
        return "commissioned today"
    text = "none today" if last is None else f"none today, the last one {last.words}"
    add(WARNING, "daily check", f"{text}: traction commission --daily")
    return text
