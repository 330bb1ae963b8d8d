"""Where the files of a trial stand: they follow what the journal decided."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from acquisition.errors import TrialFileError
from acquisition.trial_file.data_files import is_there, list_folder
from experiments.session.data_files import (
    move_file,
    read_json,
    remove_file,
    sha256_of,
    write_json,
)
from experiments.session.reducer import KEEP, REJECT
from experiments.session.sidecar import TrialName
from experiments.session.states import Event
from experiments.session.store import SessionFolder

_SUFFIXES = (".mcap", ".truth.mcap")
_VERDICTS: Mapping[str, str] = {
    Event.TRIAL_KEPT: KEEP,
    Event.TRIAL_REJECTED: REJECT,
    Event.SET_ASIDE: REJECT,
}
_Facts = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Verdict:
    """A verdict on one attempt, as the journal has it.

    Attributes:
        name: the attempt.
        verdict: "keep" or "reject".
        reason: why; may be empty for "keep".
        who: whose verdict it is.
        when: UTC as text.
    """

    name: TrialName
    verdict: str
    reason: str
    who: str
    when: str


def decision_of(event: _Facts) -> Verdict | None:
    """Return the verdict in `event` of the journal, None where there is none."""
    kind = str(event.get("event"))
    verdict = _VERDICTS.get(kind)
    if kind == Event.VERDICT:
        verdict = str(event.get("verdict"))
    number, attempt = event.get("trial"), event.get("attempt")
    if verdict is None or type(number) is not int or type(attempt) is not int:
        return None
    texts = (str(event.get(key) or "") for key in ("reason", "who", "utc"))
    return Verdict(TrialName(number, attempt), verdict, *texts)


def last_decisions(events: Iterable[_Facts]) -> list[Verdict]:
    """Return the newest verdict on every attempt, in the order they were given."""
    newest: dict[TrialName, Verdict] = {}
    for event in events:
        decision = decision_of(event)
        if decision is not None:
            newest.pop(decision.name, None)
            newest[decision.name] = decision
    return list(newest.values())


def find_sidecar(folder: SessionFolder, name: TrialName) -> dict[str, Any]:
    """Return the sidecar of an attempt, wherever it stands; empty for none."""
    kept = read_json(folder.trials / f"{name.kept}.json")
    if kept and kept.get("attempt") == name.attempt:
        return kept
    return read_json(folder.rejected / f"{name.rejected}.json")


def check_sidecar(folder: SessionFolder, name: TrialName) -> dict[str, Any]:
    """Return the sidecar of an attempt that is about to be changed.

    Raises:
        TrialFileError: it is missing or damaged: what follows could not be finished.
    """
    sidecar = find_sidecar(folder, name)
    if sidecar.get("attempt") == name.attempt:
        return sidecar
    path = folder.rejected / f"{name.rejected}.json"
    if not is_there(path):
        path = folder.trials / f"{name.kept}.json"
    raise TrialFileError(
        path,
        "is damaged" if is_there(path) else "is missing",
        hint="Copy it back from a backup. Nothing was changed.",
    )


def recorded_sum(sidecar: _Facts) -> dict[str, object]:
    """Return checksum and size of the recording as a sidecar has them."""
    kinds = {"sha256": str, "size": int}
    return {key: sidecar[key] for key in kinds if type(sidecar.get(key)) is kinds[key]}


def move_trial_files(folder: SessionFolder, decision: Verdict) -> None:
    """Let the files of an attempt follow the verdict on it.

    The sidecar moves last, so a call that was cut short can be repeated; a second call
    changes nothing. A verdict that was there before goes into the sidecar's history.

    Raises:
        TrialFileError: the disk is full or gone, or another file stands in the way.
    """
    name, is_kept = decision.name, decision.verdict == KEEP
    at_trials = folder.trials / f"{name.kept}.json"
    at_rejected = folder.rejected / f"{name.rejected}.json"
    source, target = (at_rejected, at_trials) if is_kept else (at_trials, at_rejected)
    sidecar = find_sidecar(folder, name)
    holds_source = is_kept or _holds(folder, name)
    if holds_source:
        for suffix in _SUFFIXES:
            path = source.with_suffix(suffix)
            if is_there(path):
                move_file(path, target.with_suffix(suffix))
    changed = _with_verdict(sidecar, decision)
    if not is_there(target) or read_json(target) != changed:
        write_json(target, changed)
    if holds_source:
        remove_file(source)


def kept_sidecars(folder: SessionFolder) -> list[dict[str, Any]]:
    """Return the sidecars of the trials kept so far, in the order of their numbers."""
    sidecars = [read_json(path) for path in list_folder(folder.trials, "T*.json")]
    return [sidecar for sidecar in sidecars if sidecar.get("verdict") == KEEP]


def add_remark(folder: SessionFolder, name: TrialName, text: str, who: str) -> str:
    """Add a remark, which the journal has as its last event, to an attempt's sidecar.

    Returns:
        Name of the sidecar.

    Raises:
        TrialFileError: the disk is full or gone.
    """
    path = sidecar_path(folder, name)
    sidecar = find_sidecar(folder, name)
    remark = {"text": text, "who": who, "when": folder.events()[-1]["utc"]}
    notes = [*_list(sidecar, "notes"), remark]
    write_json(path, {**sidecar, "notes": notes})
    return path.stem


def write_next_tare(
    folder: SessionFolder, name: TrialName, tare: Mapping[str, object]
) -> None:
    """Write the tare that followed a trial into its sidecar, wherever it stands.

    Args:
        folder: the session.
        name: the attempt; one without a sidecar is left alone.
        tare: `t_ns`, its host time [ns], and `bias`, the reading without load.

    Raises:
        TrialFileError: the disk is full or gone.
    """
    sidecar = find_sidecar(folder, name)
    if sidecar.get("attempt") == name.attempt:
        write_json(sidecar_path(folder, name), {**sidecar, "next_tare": dict(tare)})


def sidecar_path(folder: SessionFolder, name: TrialName) -> Path:
    """Return where the sidecar of an attempt stands."""
    path = folder.trials / f"{name.kept}.json"
    return path if _is_of(path, name) else folder.rejected / f"{name.rejected}.json"


def _list(fields: _Facts, key: str) -> list[object]:
    """Return the list at `key`, an empty one where there is anything else."""
    value = fields.get(key)
    return list(cast("list[object]", value)) if isinstance(value, list) else []


def _is_of(sidecar: Path, name: TrialName) -> bool:
    return read_json(sidecar).get("attempt") == name.attempt


def _holds(folder: SessionFolder, name: TrialName) -> bool:
    """Return whether the recording of that number in trials/ is of this attempt.

    A sidecar that is damaged or missing cannot tell: the checksum in the journal does.
    """
    recording = folder.trials / f"{name.kept}.mcap"
    sidecar = recording.with_suffix(".json")
    if "attempt" in read_json(sidecar):
        return _is_of(sidecar, name)
    wanted = folder.recorded_sums().get((name.number, name.attempt))
    is_known = wanted is not None and is_there(recording)
    return is_known and sha256_of(recording) == wanted


def _with_verdict(sidecar: _Facts, decision: Verdict) -> dict[str, object]:
    """Return the sidecar with the verdict, the one before it in its history."""
    given = {
        "verdict": decision.verdict,
        "reason": decision.reason,
        "who": decision.who,
        "when": decision.when,
    }
    before = {key: sidecar.get(key, "") for key in given}
    history = _list(sidecar, "history")
    if before["verdict"] and before != given:
        history.append(before)
    named = {"trial": decision.name.kept, "attempt": decision.name.attempt}
    return {**named, **sidecar, **given, "history": history}
