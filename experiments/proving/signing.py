"""What two persons type: their names at the end, and what they accept."""

import sys
from collections.abc import Sequence
from datetime import UTC, datetime

from acquisition.clock import SystemClock
from acquisition.errors import SettingsError
from experiments.commissioning.gate import lacks
from experiments.commissioning.record import Acceptance
from experiments.commissioning.steps import ORDER, ProofStep
from experiments.operator.console import WARNING, Console
from experiments.proving.guide import RecordFolder, accept
from experiments.proving.work import WORK

_LONGEST_NAME, _LONGEST_REASON = 100, 300  # characters
_NOTHING = "Nothing was written."


def accept_failed(
    files: RecordFolder,
    step: str,
    terrain: str,
    persons: tuple[str, str],
    reason: str,
    console: Console,
) -> None:
    """Have two persons accept what failed in a step.

    Args:
        files: the record.
        step: as it was typed.
        terrain: whose container C13 looked at.
        persons: operator and witness where there is no terminal.
        reason: why, where there is no terminal.
        console: where it is asked.

    Raises:
        SettingsError: there is no such step, it was not done or did not fail, nobody
            may accept it, or two names and a reason are missing.
    """
    if step not in ORDER:
        raise SettingsError(
            f"There is no step {step[:20]!r}.",
            hint=f"Steps: {' '.join(ORDER)}. {_NOTHING}",
        )
    subject = terrain if step == ProofStep.CONTAINER else ""
    done = files.record.of(ProofStep(step), subject)
    if done is None:
        raise SettingsError(f"{step} was not done.", hint=_NOTHING)
    console.say(f"{done.name} failed: {done.cause}")
    names = two_names(persons, console, "Who accepts this answers for it.")
    if _is_terminal():
        console.say("Why it may be so, then Enter:")
        reason = sys.stdin.readline()
    reason = " ".join(reason.split())[:_LONGEST_REASON]
    if names is None or not reason:
        raise SettingsError(
            "That takes two persons and a reason.",
            hint=f"--operator NAME --witness NAME --reason TEXT. {_NOTHING}",
        )
    now = datetime.fromtimestamp(SystemClock().utc_ns() // 1_000_000_000, UTC)
    accept(files, done, Acceptance(names=names, reason=reason, when=now))
    console.say(
        f"{done.name} is accepted. The record, its page, every recording and the head "
        "of the report say so."
    )


def sign_end(
    files: RecordFolder,
    terrain: str,
    persons: tuple[str, str],
    offers: Sequence[str],
    console: Console,
) -> None:
    """Say what is left, or have the record signed by two persons.

    Args:
        files: the record.
        terrain: whose container C13 looked at.
        persons: operator and witness where there is no terminal.
        offers: values of rig.toml that were measured otherwise.
        console: where it is said.
    """
    last = max((done.ended for done in files.record.steps), default=None)
    found = lacks(files.record, {}, last, terrain) if last else []
    lacking = [lack.step for lack in found] if last else ORDER
    missing = [step for step in WORK if step in lacking]
    if missing:
        console.say(f"Still to do: {', '.join(missing)}.")
        return
    for done in files.record.steps:
        if done.accepted is not None:
            who = " and ".join(done.accepted.names)
            console.say(f" {WARNING} {done.name} failed and was accepted by {who}")
    accepted = " and accepts rig.toml as it stands" if offers else ""
    names = two_names(persons, console, f"Who signs has seen every step{accepted}.")
    if names is None:
        console.say(
            "Not signed: that takes two persons. Everything is kept; sign it with "
            "traction commission, --operator NAME and --witness NAME."
        )
        return
    files.sign(names)
    console.say(f"Written and signed: {files.folder / 'commissioning.json'}.")


def two_names(
    persons: tuple[str, str], console: Console, words: str
) -> tuple[str, str] | None:
    """Return two different names, typed where there is a terminal; None = no two.

    Args:
        persons: the names where there is no terminal.
        console: where they are asked for.
        words: what it means to give them.
    """
    typed = persons
    if _is_terminal():
        console.say(words)
        console.say("Name of the person who did it, then Enter:")
        first = sys.stdin.readline().strip()
        console.say("Name of the person who stood by, then Enter:")
        typed = (first, sys.stdin.readline().strip())
    one, two = (name.strip()[:_LONGEST_NAME] for name in typed)
    return (one, two) if one and two and one != two else None


def _is_terminal() -> bool:
    return sys.stdin is not None and sys.stdin.isatty()
