"""Steps before a trial: activation, reset of the terrain, notes, pauses, review."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from acquisition.control_loop.states import ArmState
from acquisition.devices import BusCondition, SafetyMode
from acquisition.sample import MOTOR_FRESH_SHIFT
from experiments.messages import BUS_WORDS, preflight_error, pucks_have
from experiments.operator.keys import KeyAction, key_action, screen_keys
from experiments.operator.prompts import Prompt
from experiments.operator.screens import ReadyView, ready_lines
from experiments.run.console_loop import ConsoleLoop
from experiments.run.context import RunContext, RunServices
from experiments.run.kept_trials import kept_rows
from experiments.run.quality import review_trial, thinnest_cell
from experiments.run.stop import ArmFaultError, StopRequestedError
from experiments.run.verdicts import take_note
from experiments.session.sidecar import TrialName
from experiments.session.states import Event

PATIENCE = 120.0  # time to activate the arm [s]
_READY_SECONDS = 0.1  # from the request for hold to its first torques


def activate(console_loop: ConsoleLoop) -> None:
    """Start the torques, then wait for the pendant and for [space].

    Raises:
        PreflightError: there are no torques, or the arm was not activated within two
            minutes.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    control, clock = console_loop.loop_client, console_loop.rig.clock
    console_loop.require_no_fault()
    control.start()
    control.advance(_READY_SECONDS)
    _require_torques(console_loop)
    console_loop.console.say(
        "Press Shift-activate on the pendant, support the arm, then [space]."
    )
    is_ready = False
    start_ns = clock.now_ns()
    while True:
        is_ready = console_loop.tick(Prompt.SUPPORT) == " " or is_ready
        if is_ready and control.status.safety is SafetyMode.ACTIVE:
            return
        if (clock.now_ns() - start_ns) * 1e-9 > PATIENCE:
            raise preflight_error("not-active", seconds=PATIENCE)


def _require_torques(console_loop: ConsoleLoop) -> None:
    """Refuse the activation of an arm without torques, which would fall.

    Hold starts with a complete reading of all positions.
    """
    control = console_loop.loop_client
    loop = control.loop
    if loop.control.state is ArmState.HOLD or loop.control.verdict is not None:
        return  # ready, or the next tick raises the fault
    if loop.control.safety is SafetyMode.E_STOP:
        raise preflight_error("no-power")
    silent = ~int(control.latest()["flags"][0]) >> MOTOR_FRESH_SHIFT & 0x7F
    detail = f"{pucks_have(silent)} not answered for {_READY_SECONDS * 1e3:.0f} ms."
    if loop.bus_condition is not BusCondition.SOUND:
        detail = BUS_WORDS[loop.bus_condition]
    raise preflight_error("not-ready", detail=detail)


def wait_ready(context: RunContext, name: TrialName) -> None:
    """Wait for the start of the trial, by key or by a double tap of the foot.

    Raises:
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    console_loop, feet = context.console_loop, context.watch_foot()
    while True:
        _show(context)
        action, key = None, ""
        while action is None:
            key = console_loop.tick(Prompt.READY, name) or feet.key(" ")
            action = key_action(Prompt.READY, key)
        console_loop.show(None)
        if action is KeyAction.RECORD:
            return
        if action is KeyAction.TICK:
            context.state.ticked ^= {int(key)}
            continue
        _ACTIONS[action](context, name)


def ready_view(context: RunContext) -> ReadyView:
    """Return the present content of the screen between two trials."""
    state, row = context.journal.state, context.rig.row
    folder = context.metadata.folder
    thin = context.console_loop.run_in_background(lambda: thinnest_cell(folder))
    return ReadyView(
        session=folder.id,
        terrain=row.name,
        trial=state.next_trial,
        wanted=state.wanted,
        kept=len(state.kept),
        rejected=state.rejected,
        elapsed=context.elapsed,
        left=context.time_left,
        reset=row.reset,
        thin=thin,
        ticked=frozenset(context.state.ticked),
        table=kept_rows(folder),
        given=context.state.given.text if context.state.given is not None else "",
        undo_left=context.console_loop.undo_left,
    )


def _show(context: RunContext) -> None:
    """Show the screen; on a terminal it is updated continuously."""
    view = ready_view(context)
    lines = [*ready_lines(view), screen_keys(Prompt.READY)]
    if not context.console.is_live:
        for line in lines:
            context.say(line)
        return

    def lines_now(width: int) -> list[str]:
        newer = replace(
            view,
            elapsed=context.elapsed,
            left=context.time_left,
            undo_left=context.console_loop.undo_left,
        )
        return [*ready_lines(newer, width), screen_keys(Prompt.READY)]

    context.console_loop.show(lines_now)


def _note(services: RunServices, name: TrialName) -> None:
    """Take a note on the session while the arm holds."""
    services.loop_client.request(ArmState.HOLD)
    take_note(services, name, is_on_trial=False)
    services.loop_client.request(ArmState.FLOAT)


def _pause(context: RunContext, name: TrialName) -> None:
    context.loop_client.request(ArmState.HOLD)
    context.append(Event.PAUSED)
    before = context.state.fault_context
    context.state.fault_context = replace(before, prompt=Prompt.PAUSED)
    is_over = False
    while not is_over:
        context.say("Paused. ARM: holding. [space] to go on.")
        try:
            while context.console_loop.tick(Prompt.PAUSED, name) != " ":
                pass
            is_over = True
        except ArmFaultError as fault:
            context.clear_faults(fault)  # the pause continues
    context.state.fault_context = before
    context.append(Event.CONTINUED)
    context.await_trial()


def _view_last(context: RunContext, name: TrialName) -> None:
    """Print the newest review again, or that of the last kept trial."""
    del name
    if not context.state.page:
        folder, kept = context.metadata.folder, context.journal.state.kept_trials
        if not kept:
            context.say("There is no trial to look at yet.")
            return
        path = folder.path / f"{kept[-1].relative_stem}.mcap"
        review = context.console_loop.run_in_background(lambda: review_trial(path))
        lines = [f" {mark} {text}" for mark, text in review.lines()]
        context.say_page([f"{path.stem}, recorded before:", *lines])
        return
    context.say_page(context.state.page)


def _quit_after(context: RunContext, name: TrialName) -> None:
    """Make the next trial the last one; the second time, end now.

    Raises:
        StopRequestedError: second request.
    """
    if context.state.is_last:
        raise StopRequestedError
    context.state.is_last = True
    context.say(f"{name.kept} will be the last one for now. [q] again: quit at once.")


_ACTIONS: Mapping[KeyAction, Callable[[RunContext, TrialName], None]] = {
    KeyAction.NOTE: _note,
    KeyAction.PAUSE: _pause,
    KeyAction.VIEW: _view_last,
    KeyAction.QUIT: _quit_after,
}
