"""May this command send torque to this arm? Its commissioning tells."""

from collections.abc import Collection, Mapping
from datetime import UTC, datetime

from acquisition.errors import IDLE_ARM, PreflightError, TractionError
from experiments.commissioning.gate import (
    COMPLETE,
    FIELD,
    accepted,
    lacks,
    require,
)
from experiments.commissioning.inputs import present_inputs
from experiments.commissioning.record import read_commissioning
from experiments.commissioning.steps import GATED
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
    further = [lack.text for lack in found if lack.step not in GATED]
    said = [f"uncommissioned: {'; '.join(further)}"] if further else []
    said += accepted(record, rig.row.name) if record is not None else []
    if said:
        text = ". ".join(said)
        add(WARNING, FIELD, text)
        return {FIELD: text}
    add(GOOD, FIELD, "all steps, sound and not stale")
    return {FIELD: COMPLETE}
