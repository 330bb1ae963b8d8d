"""Is the foot mounted that the terrain needs? A person says so when it changes."""

from pathlib import Path

from acquisition.errors import SessionError
from experiments.messages import CATALOGUE
from experiments.operator.console import GOOD, WARNING, Console
from experiments.operator.prompts import OperatorInput, Prompt
from experiments.preflight.conditions import FILE
from experiments.preflight.host_checks import CheckResult
from experiments.run.resume_prompt import ask
from experiments.session.store import SessionFolder, list_sessions, read_json
from experiments.settings.matrix import TerrainRow

_FOOT = "terrain.foot"  # in the conditions of a session


def foot_before(data: Path, *, is_simulated: bool) -> tuple[SessionFolder, str] | None:
    """Return the session that was open last and its foot, None before the first.

    Args:
        data: the data folder.
        is_simulated: which kind of sessions; the others say nothing about this rig.
    """
    found: list[tuple[int, SessionFolder, str]] = []
    for folder in list_sessions(data):
        journal = folder.path / "events.jsonl"
        foot = read_json(folder.path / FILE).get(_FOOT)
        if (
            folder.is_simulated is is_simulated
            and isinstance(foot, str)
            and journal.is_file()
        ):
            found.append((journal.stat().st_mtime_ns, folder, foot))
    if not found:
        return None
    _, folder, foot = max(found, key=lambda entry: (entry[0], entry[1].path.name))
    return folder, foot


def confirm_foot(
    row: TerrainRow,
    before: tuple[SessionFolder, str] | None,
    keys: OperatorInput,
    console: Console,
) -> CheckResult:
    """Return the line about the foot for the page; ask when it is another one.

    Raises:
        SessionError: nobody confirmed it.
    """
    if before is None or before[1] == row.foot:
        return CheckResult(GOOD, "foot", row.foot)
    folder, foot = before
    message = CATALOGUE["foot-changed"]
    facts = {"session": folder.id, "before": foot, "terrain": row.name}
    facts["foot"] = row.foot
    what = message.what.format_map(facts)
    console.say(f"{WARNING} {what} {message.do.format_map(facts)}")
    if ask(keys, Prompt.FOOT, {" ", "q"}) == "q":
        raise SessionError(what, hint="Nothing was started.")
    text = f"{row.foot}, mounted since {folder.id} ({foot}), as confirmed"
    return CheckResult(GOOD, "foot", text)
