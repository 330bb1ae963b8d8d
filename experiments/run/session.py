"""One opening of a session, from connecting the rig to the arm at rest."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from acquisition.errors import TractionError, UnfitDeviceError
from experiments.arguments import data_option
from experiments.operator.console import Console
from experiments.operator.prompts import OperatorInput
from experiments.operator.terminal import keyboard
from experiments.preflight.conditions import (
    check_conditions,
    confirm_foot,
    last_foot,
    rig_conditions,
    sensor_conditions,
)
from experiments.preflight.connecting import connect_rig
from experiments.preflight.preflight import Preflight, run_preflight
from experiments.rig.bus_log import logging_bus
from experiments.rig.rig import FakeOptions, Rig
from experiments.rig.simulation import SimulatedHand
from experiments.run.console_loop import ConsoleLoop
from experiments.run.context import busy_load
from experiments.run.fault_plan import plan_faults
from experiments.run.host_faults import HostFaults
from experiments.run.runner import SessionRunner
from experiments.run.stop import StopFlag, handle_signals
from experiments.run.trial import SessionMetadata, collect_metadata
from experiments.session.data_files import write_json, write_text
from experiments.session.journal import Journal
from experiments.session.lock import session_lock
from experiments.session.never_started import remove_never_started
from experiments.session.recorded_conditions import write_conditions
from experiments.session.states import Event
from experiments.session.store import create_session, session_utc_ns
from experiments.session.summaries import summarise_all_unverified
from experiments.session.upcoming import next_steps
from experiments.session.where import Where
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow


@dataclass(frozen=True, slots=True)
class SessionRequest:
    """Request for a session: data folder, rig, operator.

    Attributes:
        data: the data folder.
        settings: rig.toml and matrix.toml.
        config: path of the rig.toml; None = as shipped.
        row: row of the matrix.
        fake: options of the simulation; None = real rig.
        operator_name: name; empty = not given.
        operator: answers the prompts.
        console: output.
        faults: faults to inject into the simulation, as on the command line.
        can_log: log file of the bus.
    """

    data: Path
    settings: Settings
    config: Path | None
    row: TerrainRow
    fake: FakeOptions | None
    operator_name: str
    operator: OperatorInput
    console: Console
    faults: tuple[str, ...] = ()
    can_log: Path | None = None

    @property
    def who(self) -> str:
        """Name of the operator: as given, else that of the keyboard's user."""
        return self.operator_name or self.operator.who


@dataclass(frozen=True, slots=True)
class OpenMode:
    """Kind of opening of a session.

    Attributes:
        event: started, resumed, or for a redo.
        details: fields of the event in the journal.
        journal: journal of an existing session, its lock held; None = new session.
        is_forced: record under other conditions, too.
    """

    event: Event
    details: Mapping[str, object] = field(default_factory=dict[str, object])
    journal: Journal | None = None
    is_forced: bool = False


def run_session(request: SessionRequest, mode: OpenMode) -> int:
    """Connect, check, record; returns the exit code.

    Raises:
        PreflightError: the rig fails the preflight.
        SessionError: the conditions differ from those of the session.
    """
    console, stop = request.console, StopFlag()
    rig = connect_rig(request.settings, request.row, request.fake)
    with logging_bus(rig, request.can_log, console):
        host_faults = HostFaults(rig)
        faults = plan_faults(request.faults, rig.simulation, host_faults)
        kind = "SIMULATED" if rig.is_simulated else "LIVE RIG"
        console.say(f"traction run {request.row.name}        {kind}")
        differences = _check_conditions(rig_conditions(rig), mode, console)
        try:
            page = _check_rig(request, rig, host_faults)
        except UnfitDeviceError as error:
            load = busy_load(rig, is_rehearsed=bool(request.faults))
            if load is None:
                raise
            raise load.blamed(error) from error
        sensor = sensor_conditions(page.devices)
        differences += _check_conditions(sensor, mode, console)
        simulated = rig.simulation
        hand = None if simulated is None else SimulatedHand(simulated)
        operator = request.operator
        with handle_signals(stop), keyboard(operator), ExitStack() as stack:
            stack.callback(host_faults.restore)
            console_loop = ConsoleLoop(rig, console, operator, stop, hand, faults)

            def open_session() -> tuple[Journal, SessionMetadata]:
                journal = _open_journal(request, mode, rig, stack, host_faults)
                if mode.journal is None:
                    write_conditions(journal.folder, {**rig_conditions(rig), **sensor})
                return journal, _write_metadata(request, page, journal)

            journal, metadata = console_loop.run_in_background(open_session)
            runner = SessionRunner(console_loop, metadata, journal)
            code = runner.run(mode.event, **_opening_fields(request, mode, differences))
    for plan in faults.plans if faults is not None else ():
        text = plan.to_text()
        console.say(f"▲ The fault {text} was not raised: its time was not reached.")
    _print_next(request, journal, code)
    return code


def _check_rig(request: SessionRequest, rig: Rig, host_faults: HostFaults) -> Preflight:
    """Confirm the foot, then run the preflight; returns its page.

    Raises:
        PreflightError: the rig fails the preflight.
        SessionError: the foot was not confirmed.
    """
    console = request.console
    before = last_foot(request.data, is_simulated=rig.is_simulated)
    foot = confirm_foot(rig.row, before, request.operator, console)
    console.check(foot.mark, foot.name, foot.text)
    probe = host_faults.free_bytes
    page = run_preflight(rig, request.data, console, probe=probe, made_anew=())
    return page.after(foot)


def _check_conditions(
    now: Mapping[str, str], mode: OpenMode, console: Console
) -> list[str]:
    """Differences to the conditions of a session that is opened again."""
    if mode.journal is None:
        return []
    folder, is_forced = mode.journal.folder, mode.is_forced
    return check_conditions(folder, now, console, is_forced=is_forced)


def _open_journal(
    request: SessionRequest,
    mode: OpenMode,
    rig: Rig,
    stack: ExitStack,
    host_faults: HostFaults,
) -> Journal:
    """Return the journal on the rig's clock; creates and locks a new session."""
    if mode.journal is not None:
        host_faults.enter_session(mode.journal.folder)
        return replace(mode.journal, clock=rig.clock)
    utc_ns = session_utc_ns()
    remove_never_started(request.data, utc_ns)
    folder = create_session(
        request.data,
        request.row.name,
        is_simulated=rig.is_simulated,
        utc_ns=utc_ns,
    )
    host_faults.enter_session(folder)
    host_faults.hold_lock(folder)
    stack.enter_context(session_lock(folder))
    request.console.say(f"session {folder.id}: {folder.path}")
    write_text(folder.path / "config.toml", rig.settings.rig_text)
    write_text(folder.path / "matrix.toml", rig.settings.matrix_text)
    return Journal(folder, rig.clock)


def _write_metadata(
    request: SessionRequest, page: Preflight, journal: Journal
) -> SessionMetadata:
    """Write the metadata of this opening; files of later ones are numbered."""
    seed = request.fake.seed if request.fake is not None else None
    metadata = collect_metadata(journal.folder, request.who, seed, page.devices)
    number = journal.state.openings + 1
    suffix = f"-{number}" if number > 1 else ""
    path = journal.folder.path
    write_json(path / f"preflight{suffix}.json", page.as_dict())
    write_json(path / f"provenance{suffix}.json", metadata.provenance)
    write_text(path / f"diff{suffix}.patch", metadata.diff)
    return metadata


def _opening_fields(
    request: SessionRequest, mode: OpenMode, differences: list[str]
) -> dict[str, object]:
    """Fields of the journal's event of this opening, read by the next one."""
    details = {
        **mode.details,
        "operator": request.who,
        "config": str(request.config.resolve()) if request.config else "",
        "fake": asdict(request.fake) if request.fake is not None else None,
    }
    return {**details, "differences": differences} if differences else details


def _print_next(request: SessionRequest, journal: Journal, code: int) -> None:
    """Print the next steps: the report, and the next terrain."""
    name, data = journal.folder.id, data_option(request.data)
    if not journal.state.is_complete:
        request.console.say(f"To go on: traction resume {name}{data}")
    if code or not journal.state.is_complete:
        return
    request.console.say(f"Complete. Next: traction report {name}{data}")
    request.console.say(f"It writes {journal.folder.path / 'report' / 'index.html'}")
    is_simulated = journal.folder.is_simulated
    matrix = request.settings.matrix
    try:
        seen = summarise_all_unverified(request.data)
        steps = next_steps(
            request.data, seen, matrix, Where(), is_simulated=is_simulated
        )
    except TractionError as error:  # in another session; this one is complete
        steps = [f"▲ The next terrain is unknown: {error.message}"]
    for step in steps:
        request.console.say(step)
