"""Is the foot mounted that the terrain needs? A person confirms every change."""

from dataclasses import dataclass
from pathlib import Path

from acquisition import SessionError
from experiments.messages import CATALOGUE
from experiments.operator import (
    GOOD,
    WARNING,
    Console,
    KeyAction,
    OperatorInput,
    Prompt,
    wait_for_key,
)
from experiments.preflight.conditions import FOOT, read_conditions
from experiments.preflight.host_checks import CheckResult
from experiments.session import SessionFolder, list_sessions
from experiments.settings import TerrainRow


@dataclass(frozen=True, slots=True)
class MountedFoot:
    """The foot of the session that was open last.

    Attributes:
        folder: of the session.
        foot: "tread" or "bare".
    """

    folder: SessionFolder
    foot: str


def last_foot(data: Path, *, is_simulated: bool) -> MountedFoot | None:
    """Return the foot of the session that was open last, None before the first.

    Args:
        data: the data folder.
        is_simulated: kind of sessions; the other kind has another rig.
    """
    mounted: list[tuple[int, str, MountedFoot]] = []
    for folder in list_sessions(data):
        journal = folder.path / "events.jsonl"
        foot = read_conditions(folder).values.get(FOOT)
        if folder.is_simulated is is_simulated and foot and journal.is_file():
            order = journal.stat().st_mtime_ns, folder.path.name
            mounted.append((*order, MountedFoot(folder, foot)))
    return max(mounted, key=lambda entry: entry[:2])[2] if mounted else None


def confirm_foot(
    row: TerrainRow,
    before: MountedFoot | None,
    operator: OperatorInput,
    console: Console,
) -> CheckResult:
    """Return the line about the foot for the page; ask when it has changed.

    Raises:
        SessionError: nobody confirmed it.
    """
    if before is None or before.foot == row.foot:
        return CheckResult(GOOD, "foot", row.foot)
    session = before.folder.id
    message = CATALOGUE["foot-changed"]
    details = {"session": session, "before": before.foot, "terrain": row.name}
    details["foot"] = row.foot
    what = message.what.format_map(details)
    console.say(f"{WARNING} {what} {message.do.format_map(details)}")
    if wait_for_key(operator, Prompt.FOOT) is KeyAction.QUIT:
        raise SessionError(what, hint="Nothing was started.")
    text = f"{row.foot}, mounted since {session} ({before.foot}), as confirmed"
    return CheckResult(GOOD, "foot", text)
