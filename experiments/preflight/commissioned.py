"""May this command send torque to this arm? Its commissioning tells."""

from collections.abc import Collection, Mapping
from datetime import UTC, datetime

from acquisition.errors import IDLE_ARM, PreflightError, TractionError
from experiments.commissioning import daily
from experiments.commissioning.gate import (
    COMPLETE,
    FIELD,
    lacks,
    require,
)
from experiments.commissioning.inputs import present_inputs
from experiments.commissioning.record import Commissioning, read_commissioning
from experiments.commissioning.steps import GATED, ProofStep
from experiments.dates import is_ahead, is_fresh
from experiments.messages import preflight_error
from experiments.operator.console import BAD, GOOD, WARNING
from experiments.preflight.page import Add
from experiments.rig.rig import Rig
from wam.driver.startup import ArmInfo


def check_commissioned(
    rig: Rig,
    info: ArmInfo,
    add: Add,
    made_anew: Collection[str] = (),
    sensor: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Refuse torque for an arm that is not commissioned; return words for recordings.

    Args:
        rig: a real one, started, its loop not running.
        info: of the start.
        add: takes the line for the page.
        made_anew: names of `steps.BASES` that the command measures anew.
        sensor: what the wrist sensor says of itself; None = it was not asked.

    Raises:
        PreflightError: a step that it needs is missing, wrong or stale.
    """
    now = datetime.fromtimestamp(rig.clock.utc_ns() // 1_000_000_000, UTC)
    try:
        record = read_commissioning(rig.settings.folder)
        if record is not None and record.is_simulated:
            record = None  # of no real arm
        answers = rig.backend.arm.answers()
        present = present_inputs(rig, answers, info, sensor)
        known = {name: each for name, each in present.items() if name not in made_anew}
        found = lacks(record, known, now, rig.row.name)
        require(found)
    except TractionError as error:
        add(BAD, FIELD, error.message)
        raise PreflightError(
            error.message, hint=error.hint, arm_state=IDLE_ARM
        ) from error
    said_daily = _check_daily(rig, record, now, add)
    further = [lack.text for lack in found if lack.step not in GATED]
    if further:
        text = f"uncommissioned: {'; '.join(further)}"
        add(WARNING, FIELD, text)
        return {FIELD: text, daily.FIELD: said_daily}
    add(GOOD, FIELD, "all steps, sound and not stale")
    return {FIELD: COMPLETE, daily.FIELD: said_daily}


def _check_daily(
    rig: Rig, record: Commissioning | None, now: datetime, add: Add
) -> str:
    """Refuse an arm whose last daily check failed; return words for recordings.

    Where there was none today, that is said. The day of the commissioning needs none.

    Raises:
        PreflightError: the last daily check failed, or its date has not come yet.
    """
    try:
        history = daily.read_history(rig.settings.folder, is_simulated=False)
    except TractionError as error:
        add(BAD, "daily check", error.message)
        raise PreflightError(
            error.message, hint=error.hint, arm_state=IDLE_ARM
        ) from error
    ramps = record.of(ProofStep.RAMPS) if record is not None else None
    proved = ramps.ended if ramps is not None else None
    last = history.checks[-1] if history.checks else None
    if last is not None and (proved is None or last.ended > proved):
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
    elif proved is not None and is_fresh(proved, now, daily.COUNTS_FOR):
        add(GOOD, "daily check", "commissioned today")
        return "commissioned today"
    text = "none today" if last is None else f"none today, the last one {last.words}"
    add(WARNING, "daily check", f"{text}: traction commission --daily")
    return text
