"""One opening of a session from connecting the rig to the arm at rest."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path

from experiments.arguments import data_option
from experiments.fault_injection.host_faults import HostFaults
from experiments.fault_injection.plan import plan_faults
from experiments.operator.console import Console
from experiments.operator.prompts import OperatorInput, SimulatedHand
from experiments.operator.terminal import keyboard
from experiments.preflight.conditions import (
    check_conditions,
    conditions_of,
    sensor_conditions,
    write_conditions,
)
from experiments.preflight.foot_check import confirm_foot, foot_before
from experiments.preflight.preflight import Preflight, connect_rig, run_preflight
from experiments.rig.bus_log import logging_bus
from experiments.rig.rig import FakeOptions, Rig
from experiments.run.console_loop import ConsoleLoop
from experiments.run.participants import Company, StopFlag, signals_ask
from experiments.run.runner import SessionRunner
from experiments.session.journal import Journal
from experiments.session.lock import session_lock
from experiments.session.matrix_board import next_steps
from experiments.session.states import Event
from experiments.session.store import (
    create_session,
    session_utc_ns,
    write_json,
    write_text,
)
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from experiments.trial.header import SessionFacts, collect_facts


@dataclass(frozen=True, slots=True)
class SessionRequest:
    """What a person asked for: where, with which rig, and who takes part.

    Attributes:
        data: the data folder.
        settings: rig.toml and matrix.toml.
        config: the rig.toml that was named; None = as shipped.
        row: row of the matrix.
        fake: how the rig is simulated; None = it is real.
        operator: name of the person; empty = nobody said.
        keys: who answers the prompts.
        console: where it is said.
        faults: to be raised in the simulation, as on the command line.
        can_log: where the bus is written to.
    """

    data: Path
    settings: Settings
    config: Path | None
    row: TerrainRow
    fake: FakeOptions | None
    operator: str
    keys: OperatorInput
    console: Console
    faults: tuple[str, ...] = ()
    can_log: Path | None = None

    @property
    def who(self) -> str:
        """Name of the operator, "auto" in a simulation without one."""
        return self.operator or ("auto" if self.fake is not None else "")


@dataclass(frozen=True, slots=True)
class OpenMode:
    """How a session is opened.

    Attributes:
        event: started, resumed, or for a redo.
        asked: what the journal keeps of it.
        book: of the session on the disk, its lock held; None = a new session.
        is_forced: other conditions than before are no obstacle.
    """

    event: Event
    asked: Mapping[str, object] = field(default_factory=dict[str, object])
    journal: Journal | None = None
    is_forced: bool = False


def run_session(request: SessionRequest, opening: OpenMode) -> int:
    """Connect, check, record; return the exit code.

    Raises:
        PreflightError: the rig is not fit.
        SessionError: the conditions are not those of the session.
    """
    console, stop = request.console, StopFlag()
    rig = connect_rig(request.settings, request.row, request.fake)
    with logging_bus(rig, request.can_log, console):
        host_faults = HostFaults(rig)
        faults = plan_faults(request.faults, rig.simulation, host_faults)
        kind = "SIMULATED" if rig.is_simulated else "LIVE RIG"
        console.say(f"traction run {request.row.name}        {kind}")
        found = _check_before(rig, opening, console)
        before = foot_before(request.data, is_simulated=rig.is_simulated)
        foot = confirm_foot(rig.row, before, request.keys, console)
        console.check(foot.mark, foot.name, foot.text)
        page = run_preflight(rig, request.data, console).after(foot)
        found += _check_sensor(page, opening, console)
        hand = SimulatedHand(rig.simulation) if rig.simulation else None
        company = Company(request.keys, console, stop, hand, faults)
        with signals_ask(stop), keyboard(request.keys), ExitStack() as stack:
            stack.callback(host_faults.undo)
            journal = opening.journal or _new_book(
                request, rig, page, stack, host_faults
            )
            host_faults.folder = journal.folder
            facts = _write_facts(request, rig, page, journal)
            runner = SessionRunner(ConsoleLoop(rig, company), facts, journal)
            code = runner.run(opening.event, **_asked(request, opening, found))
    for plan in faults.plans if faults is not None else ():
        console.say(f"▲ The fault {plan.text()} was planned, and its time never came.")
    _say_next(request, journal, code)
    return code


def _check_before(rig: Rig, opening: OpenMode, console: Console) -> list[str]:
    if opening.journal is None:
        return []
    now, is_forced = conditions_of(rig), opening.is_forced
    return check_conditions(opening.journal.folder, now, console, is_forced=is_forced)


def _check_sensor(page: Preflight, opening: OpenMode, console: Console) -> list[str]:
    if opening.journal is None:
        return []
    now, is_forced = sensor_conditions(page.devices), opening.is_forced
    return check_conditions(opening.journal.folder, now, console, is_forced=is_forced)


def _new_book(
    request: SessionRequest,
    rig: Rig,
    page: Preflight,
    stack: ExitStack,
    host_faults: HostFaults,
) -> Journal:
    """Create the session's folder, take its lock, keep settings and conditions."""
    folder = create_session(
        request.data,
        request.row.name,
        is_simulated=rig.is_simulated,
        utc_ns=session_utc_ns(),
    )
    host_faults.hold_lock(folder)
    stack.enter_context(session_lock(folder))
    request.console.say(f"session {folder.id}: {folder.path}")
    write_text(folder.path / "config.toml", rig.settings.rig_text)
    write_text(folder.path / "matrix.toml", rig.settings.matrix_text)
    write_conditions(folder, {**conditions_of(rig), **sensor_conditions(page.devices)})
    return Journal(folder, rig.clock)


def _write_facts(
    request: SessionRequest, rig: Rig, page: Preflight, journal: Journal
) -> SessionFacts:
    """Write what is known at this opening; later ones get a number of their own."""
    seed = request.fake.seed if request.fake is not None else None
    facts = collect_facts(journal.folder, request.who, seed, page.devices)
    journal.clock = rig.clock
    number = journal.state.openings + 1
    suffix = f"-{number}" if number > 1 else ""
    path = journal.folder.path
    write_json(path / f"preflight{suffix}.json", page.as_dict())
    write_json(path / f"provenance{suffix}.json", facts.provenance)
    write_text(path / f"diff{suffix}.patch", facts.diff)
    return facts


def _asked(
    request: SessionRequest, opening: OpenMode, found: list[str]
) -> dict[str, object]:
    """Return what the journal keeps of this opening, for whoever resumes it."""
    asked = {
        **opening.asked,
        "operator": request.who,
        "config": str(request.config.resolve()) if request.config else "",
        "fake": asdict(request.fake) if request.fake is not None else None,
    }
    return {**asked, "differences": found} if found else asked


def _say_next(request: SessionRequest, journal: Journal, code: int) -> None:
    """Say what comes next: the report, and the terrain that time asks for."""
    name, data = journal.folder.id, data_option(request.data)
    if not journal.state.is_complete:
        request.console.say(f"To go on: traction resume {name}{data}")
    if code or not journal.state.is_complete:
        return
    request.console.say(f"Complete. Next: traction report {name}{data}")
    request.console.say(f"It writes {journal.folder.path / 'report' / 'index.html'}")
    is_simulated = journal.folder.is_simulated
    matrix = request.settings.matrix
    for step in next_steps(request.data, matrix, is_simulated=is_simulated):
        request.console.say(step)
