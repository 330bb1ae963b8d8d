"""Annotations of sessions on the disk: notes, and verdicts changed later."""

import re
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.errors import SessionError
from acquisition.trial_file.data_files import is_there, list_folder
from experiments.operator.console import WARNING
from experiments.operator.terminal import login_name
from experiments.session.crash_recovery import recover_session
from experiments.session.data_files import sha256_of
from experiments.session.derivation import sidecar_of
from experiments.session.journal import Journal, open_journal
from experiments.session.kept_files import require_sound_journal
from experiments.session.lock import session_lock
from experiments.session.reducer import refusal
from experiments.session.sidecar import KEEP, TrialName
from experiments.session.states import Event
from experiments.session.store import SessionFolder

MAX_TEXT = 2000  # characters
_TRIAL = re.compile(r"^T?0*(?P<number>[1-9]\d?)(?P<letters>[a-z]{0,3})$")


def looks_like_trial(text: str) -> bool:
    """Return whether `text` names a trial, such as T04 or T04a."""
    return text.startswith("T") and _TRIAL.match(text) is not None


def parse_trial(text: str) -> tuple[int, int]:
    """Return (number, attempt) of a name such as T04b; attempt 0 for T04.

    Raises:
        SessionError: `text` is not a name of a trial.
    """
    match = _TRIAL.match(text)
    if match is None:
        raise SessionError(
            f"{text!r} is not a trial.", hint="Name one like T04, or T04a of rejected/."
        )
    attempt = 0
    for letter in match["letters"]:
        attempt = 26 * attempt + ord(letter) - ord("a") + 1
    return int(match["number"]), attempt


def clean_text(text: str) -> str:
    """Return `text` on one line, without control characters.

    Raises:
        SessionError: the text is empty or too long.
    """
    words = " ".join(text.split())
    cleaned = "".join(sign for sign in words if sign.isprintable())
    if not 0 < len(cleaned) <= MAX_TEXT:
        raise SessionError(
            f"The text has {len(cleaned)} characters, expected 1 to {MAX_TEXT}.",
            hint="Nothing was written.",
        )
    return cleaned


def author(name: str) -> str:
    """Return `name`, or the login name if it is empty."""
    return clean_text(name) if name else login_name()


def add_note(folder: SessionFolder, trial: str, text: str, who: str) -> str:
    """Write a remark into the journal, and into the sidecar of `trial` if named.

    Raises:
        SessionError: the session is open elsewhere, was never started, or has no such
            trial; or the text is empty.
    """
    text, who = clean_text(text), author(who)
    with session_lock(folder):
        journal = _journal(folder)
        if not trial:
            journal.append(Event.NOTED, text=text, who=who)
            return f"Noted on {folder.id}."
        name = _find_attempt(journal, trial)
        journal.append(
            Event.NOTED, trial=name.number, attempt=name.attempt, text=text, who=who
        )
        return f"Noted on {folder.id} {journal.state.attempt_at(name).stem}."


def change_verdict(
    folder: SessionFolder, trial: str, verdict: str, reason: str, who: str
) -> list[str]:
    """Keep or reject a trial recorded earlier; returns the lines to print.

    Raises:
        SessionError: the session is open elsewhere, has no such trial, another attempt
            is kept, or its file was changed.
    """
    reason, who = clean_text(reason), author(who)
    with session_lock(folder):
        journal = _journal(folder)
        name = _find_attempt(journal, trial)
        fields: dict[str, object] = {
            "trial": name.number,
            "attempt": name.attempt,
            "verdict": verdict,
            "reason": reason,
            "who": who,
        }
        refused = refusal(journal.state, {"event": Event.VERDICT, **fields})
        if refused:
            raise SessionError(
                f"{trial} of {folder.id} cannot get this verdict: {refused}.",
                hint="Nothing was changed.",
            )
        if verdict == KEEP:
            remarks = _check_file(journal, name)
        else:
            lost = _lost_file(journal, name)
            remarks = [f"{WARNING} {lost}"] if lost else []
        journal.append(Event.VERDICT, **fields)
        path = journal.state.attempt_at(name).relative_stem
        kept, wanted = len(journal.state.kept), journal.state.wanted
        return [
            *remarks,
            f"{path}: {verdict}. {folder.id} has {kept} of {wanted} kept.",
        ]


def trial_path(folder: SessionFolder, trial: str) -> Path:
    """Return the file of a trial, kept or rejected, without opening the session.

    Raises:
        SessionError: there is no such trial.
    """
    number, attempt = parse_trial(trial)
    name = TrialName(number, attempt)
    path = folder.trials / f"{name.kept}.mcap"
    if attempt:
        path = folder.rejected / f"{name.rejected}.mcap"
    if not is_there(path):
        files = list_folder(folder.trials, "T*.mcap")
        files += list_folder(folder.rejected, "T*.mcap")
        trials = sorted(p.stem for p in files if "." not in p.stem)
        raise SessionError(
            f"There is no {trial} in {folder.id}.",
            hint=f"Trials: {' '.join(trials) or 'none'}.",
        )
    return path


def _journal(folder: SessionFolder) -> Journal:
    require_sound_journal(folder)
    journal = open_journal(folder, SystemClock())
    recover_session(journal)
    return journal


def _find_attempt(journal: Journal, trial: str) -> TrialName:
    """Resolve `trial` to an attempt: T04a itself, T04 the kept or only one.

    Raises:
        SessionError: `trial` matches no attempt, or several.
    """
    number, attempt = parse_trial(trial)
    last = journal.state.attempt(number)
    kept = journal.state.kept_attempt(number)
    if not attempt and not kept and last > 1:
        names = [TrialName(number, i).rejected for i in range(1, last + 1)]
        raise SessionError(
            f"{trial} was rejected {last} times: {' '.join(names)}.",
            hint="Name one of them. Nothing was changed.",
        )
    attempt = attempt or kept or 1
    if attempt > last:
        names = dict.fromkeys(a.name.kept for a in journal.state.attempts)
        trials = " ".join(names) or "none yet"
        raise SessionError(
            f"There is no {trial} in {journal.folder.id}.", hint=f"Trials: {trials}."
        )
    return TrialName(number, attempt)


def _check_file(journal: Journal, name: TrialName) -> list[str]:
    """Return the warnings about a trial that is to be kept.

    Raises:
        SessionError: its file is missing or changed.
    """
    if lost := _lost_file(journal, name):
        raise SessionError(lost, hint="It cannot count. Nothing was changed.")
    sidecar = sidecar_of(journal.folder, journal.state.attempt_at(name))
    status = sidecar.get("status")
    if status == "complete":
        return []
    return [f"{WARNING} {name.rejected} is {status}: {sidecar.get('stop_reason')}."]


def _lost_file(journal: Journal, name: TrialName) -> str:
    """Return what is wrong with the file of a trial; "" if it is as recorded."""
    attempt = journal.state.attempt_at(name)
    sidecar = sidecar_of(journal.folder, attempt)
    path = journal.folder.path / f"{attempt.relative_stem}.mcap"
    if is_there(path) and sha256_of(path) == sidecar.get("sha256"):
        return ""
    return f"{path.name} is missing or is not what was recorded."
