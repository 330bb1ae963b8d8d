"""One recording of stances: the arm stands by itself, the policy is asked every 20 ms.

The law of the sole, the guard and the limits are those of every trial; what the arm may
do by itself it does in hold, with joint 7 locked. Only a simulated arm takes it.
"""

from collections.abc import Mapping
from pathlib import Path

from acquisition.control_loop.states import ArmState
from acquisition.errors import PreflightError, SettingsError, TractionError
from analysis.breakaway.fitting import fit_pushes
from analysis.breakaway.model import BreakAwayModel
from analysis.breakaway.recorded import BreakAwayOptions
from analysis.foresight.engine import ForesightFlag
from analysis.stance.interface import risk_tables
from analysis.stance.outcomes import FRESH_SCALE, StanceOutcome, totals
from analysis.stance.policies import POLICIES
from analysis.stance.sequence import SoleView, StancePlan, StanceSequence
from experiments.fault_injection.plan import FaultTrigger
from experiments.messages import FaultContext
from experiments.operator.console import GOOD, WARNING
from experiments.operator.prompts import Prompt
from experiments.rig.rig import Rig
from experiments.run.console_loop import TICK
from experiments.run.context import RunContext, RunServices
from experiments.session.sidecar import STANCES, TrialName, TrialOutcome
from experiments.session.stance_task import StanceTask, adapted_scale, stance_pushes
from experiments.session.store import SessionFolder

LIVE_STANCE = (
    "Stances are not available on a real arm: impedance and policies "
    "were tested in simulation only. The arm was not touched."
)
_STEP = 0.754878  # of the row of spots, from trial to trial
_STUCK = (
    "The foot makes no progress ({state}). The arm holds. Check "
    "the foot; the recording is then repeated."
)


class StuckFootError(TractionError):
    """A foot that did not get on, recording after recording."""

    def __init__(self, times: int, session: str) -> None:
        """Say how often in a row, in the session of that name."""
        super().__init__(
            f"The foot got stuck in {times} recordings in a row.",
            hint="Check the foot and the friction of the arm. To go on: "
            f"traction resume {session}",
        )


def fresh_models(
    rig: Rig, data: Path, *, but: SessionFolder | None = None
) -> dict[str, BreakAwayModel]:
    """Return break-away as stances of earlier sessions taught it, by terrain.

    Of terrains with three recordings and enough slips. A push by hand meets stones that
    it has pressed and pushed before; a foot that is set down does not.
    """
    kinds = {row.name: row.stones for row in rig.settings.matrix.terrains}
    pushes = stance_pushes(data, but=but)
    known = {name: trials for name, trials in pushes.items() if name in kinds}
    return fit_pushes(known, kinds, BreakAwayOptions(draws=1))


def check_stances(rig: Rig, task: StanceTask, data: Path) -> None:
    """Refuse a rig on which the task cannot be done.

    Args:
        rig: the rig, connected.
        task: what its foot is to do.
        data: the data folder.

    Raises:
        PreflightError: it is a real one.
        SettingsError: the container is too short, the risk is not known, or was
            learnt on another rig.
    """
    if rig.simulation is None:
        raise PreflightError(LIVE_STANCE, hint="Add --fake. Nothing was started.")
    task.check_travel(rig.row.name, rig.frame.travel)
    if not task.is_foreseen:
        return
    source = rig.foresight
    if source is None or not source.break_away:
        if fresh_models(rig, data):
            return
        raise SettingsError(
            "avoid-slip needs the risk of break-away, and none is known here.",
            hint="Record stances with --policy constant-mu and none, three recordings "
            "or more; or pushes and traction report --all; or name a terrain database "
            "with --foresight. Nothing was started.",
        )
    if not source.model.knows(rig.identity):
        raise SettingsError(
            f"{source.path} was trained on another foot or rig.",
            hint="Make one here: traction report --all. Nothing was started.",
        )


def stance_plan(services: RunServices, task: StanceTask, name: TrialName) -> StancePlan:
    """Return the plan of a recording; what kept stances have taught goes on."""
    rig, folder = services.rig, services.metadata.folder
    models, first = dict[str, BreakAwayModel](), 1.0
    if task.is_foreseen:
        fresh = fresh_models(rig, folder.path.parent.parent, but=folder)
        if rig.foresight is not None:
            models.update(rig.foresight.break_away)
        models.update(fresh)
        first = 1.0 if fresh else FRESH_SCALE
    return StancePlan(
        policy=POLICIES[task.policy],
        request=task.request,
        count=task.count,
        travel=rig.frame.travel,
        phase=_STEP * name.number % 1.0,
        tables=risk_tables(models),
        scale=adapted_scale(first, folder),
    )


def follow_stances(
    context: RunContext, task: StanceTask, name: TrialName, outcome: TrialOutcome
) -> None:
    """Let the foot stand until every stance is over, or a key ends it.

    Raises:
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    rig, console_loop = context.rig, context.console_loop
    sequence = StanceSequence(stance_plan(context, task, name))
    context.loop_client.request(ArmState.HOLD)
    start = rig.clock.now_ns()
    while not sequence.is_over:
        outcome.seconds = (rig.clock.now_ns() - start) * 1e-9
        context.state.fault_context = FaultContext(name.kept, outcome.seconds)
        key = console_loop.tick(Prompt.RECORDING, name)
        console_loop.inject_faults(FaultTrigger.RECORDING, name.number, outcome.seconds)
        view = _view(rig, task)
        outcome.displacement = max(outcome.displacement, view.x)
        before = len(sequence.outcomes)
        context.loop_client.stand(sequence.next_goal(view))
        if len(sequence.outcomes) > before:
            _tell(context, name, sequence, outcome)
        if key == " ":
            outcome.reason = "key"
            return
        if sequence.is_stuck:
            context.say(f"{WARNING} {_STUCK.format(state=sequence.state)}")
            outcome.reason = "stuck"
            return
    outcome.reason = STANCES


def _view(rig: Rig, task: StanceTask) -> SoleView:
    """Return what the foot does now; forces are means of the last 20 ms."""
    records = rig.backend.loop_client.last(TICK)
    at = records[-1]["foot_position"]
    _, F_t, F_n = records["traction"].mean(axis=0).tolist()
    capacity = float("nan")
    if task.policy == "oracle" and rig.simulation is not None:
        capacity = rig.simulation.capacity()
    return SoleView(
        x=float(rig.frame.displacement(at)),
        z=float(rig.frame.height(at)),
        F_t=F_t,
        F_n=F_n,
        shares=_shares(rig),
        capacity=capacity,
    )


def _shares(rig: Rig) -> Mapping[str, float]:
    """Return the terrains that foresight sees, empty where it sees none."""
    if rig.foresight is None:
        return {}
    records = rig.shared.foresight.last(1)
    if not len(records) or not int(records[-1]["flags"]) & ForesightFlag.GROUND:
        return {}
    names = rig.foresight.model.terrains
    shares = records[-1]["terrains"][: len(names)].tolist()
    return dict(zip(names, shares, strict=True))


def _tell(
    services: RunServices,
    name: TrialName,
    sequence: StanceSequence,
    outcome: TrialOutcome,
) -> None:
    """Write the newest stance down, and say what came of it."""
    newest = sequence.outcomes[-1]
    outcome.stances = [one.to_dict() for one in sequence.outcomes]
    word = "slipped" if newest.is_slip else "held"
    text = (
        f"stance {len(sequence.outcomes)}: {word}, F_n {newest.load:.1f} N, F_t "
        f"{newest.force:.1f} N, {newest.delivered:.2f} N s in {newest.seconds:.2f} s, "
        f"moved {1e3 * newest.moved:.1f} mm"
    )
    services.rig.backend.recorder.event(20, "stance", text)
    if not services.console.is_live:
        services.say(f"{name.kept}  {text}")


def stance_lines(task: StanceTask, outcome: TrialOutcome) -> list[str]:
    """Return what a recording of stances is worth, line by line."""
    rows = [StanceOutcome.from_dict(row) for row in outcome.stances]
    summed = totals(rows, task.request)
    if summed is None:
        return [f" {WARNING} no stance was finished"]
    slipped = round(summed.slips * summed.count)
    mark = GOOD if summed.count >= task.count else WARNING
    asked = f", {task.risk:g} asked" if task.is_foreseen else ""
    return [
        f" {mark} {summed.count} of {task.count} stances, {task.policy}",
        f" {GOOD} slipped {slipped} ({summed.slips:.2f}{asked}), succeeded "
        f"{summed.successes:.2f}",
        f" {GOOD} traction {summed.traction:.2f} N, F_n {summed.load:.1f} N, slid "
        f"{1e3 * summed.slid:.1f} mm a stance",
    ]
