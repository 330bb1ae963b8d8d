"""Publication of a study: a folder of recordings, tables, results and provenance.

The folder is also a data folder of Traction: `--data` accepts it.
"""

import json
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.extras import require_extra
from acquisition.formats import FORMAT
from acquisition.trial_file.data_files import list_folder, open_data
from acquisition.wording import counted
from analysis.data.load import RecordedTrial, load_trial
from experiments import provenance
from experiments.export.checksums import SUMS, write_sums
from experiments.export.crate import (
    METADATA,
    RecordingAction,
    StudyAction,
    crate_text,
)
from experiments.export.credits import (
    Author,
    Credits,
    Licence,
    citation_cff,
    datacite_json,
    licence_text,
    readme_text,
)
from experiments.export.trial_tables import export_sessions
from experiments.operator.console import WARNING, Console
from experiments.report.choices import ReportRequest
from experiments.report.sessions import report_sessions
from experiments.session.data_files import make_empty, reading, write_new
from experiments.session.derivation import derive
from experiments.session.reducer import replay
from experiments.session.store import SessionFolder, iso_utc

SESSIONS, TABLES, RESULTS = "sessions", "tables", "results"
ANALYSIS = f"{RESULTS}/analysis.json"  # the choices that a rebuild needs
TABLE = f"{RESULTS}/fits.csv"
_RECORDINGS = ("trials", "rejected")
_FOLDERS = ("", *_RECORDINGS)  # copied folders of a session, without faults/
_LEFT = (".lock", ".tmp", ".partial")
_SETTINGS = ("config.toml", "matrix.toml")


@dataclass(frozen=True, slots=True)
class PublishRequest:
    """Options of a publication.

    Attributes:
        title: title; "" = from the terrains.
        description: description; "" = from the trials.
        authors: authors, at least one.
        licence: licence of the data.
    """

    title: str
    description: str
    authors: Sequence[Author]
    licence: Licence


def publish_sessions(
    sessions: Sequence[SessionFolder],
    data: Path,
    to: Path,
    order: ReportRequest,
    request: PublishRequest,
    console: Console,
) -> None:
    """Write sessions, their tables and results as an RO-Crate below `to`.

    Args:
        sessions: sessions of one kind, verified against their journals.
        data: the data folder, for finished folds.
        to: a new or empty folder.
        order: options of the report.
        request: options of the publication.
        console: output of the written files.

    Raises:
        MissingLibraryError: rocrate is not installed.
        SessionError: `to` is not empty, or there is no kept trial.
        TrialFileError: a file cannot be read or written.
    """
    require_extra("report")
    require_extra("publish")
    make_empty(to)
    copies = [_copy_session(session, to / SESSIONS) for session in sessions]
    trials = {path: load_trial(path) for s in copies for path in s.kept_trials()}
    export_sessions(copies, to / TABLES, "csv", console)
    (to / RESULTS).mkdir()
    wanted = replace(order, out=to / RESULTS, with_pdf=True)
    report_sessions(copies, data, wanted, console)
    code = provenance.collect()
    about = _credits(trials.values(), request, code["software"])
    _write_texts(to, about, order, code, list(trials.values()))
    recordings = [_recording(to, path, trial) for path, trial in trials.items()]
    study = StudyAction(
        ended_utc=iso_utc(SystemClock().utc_ns()),
        software=code["software"],
        commit=code["commit"],
        inputs=[str(path.relative_to(to)) for path in trials],
        results=[TABLE, f"{RESULTS}/fits.json", f"{RESULTS}/report/index.html"],
    )
    text = crate_text(to, about, recordings, study)
    write_new(to / METADATA, text.encode())
    write_sums(to)
    _say(to, trials.values(), console)


def _write_texts(
    to: Path,
    about: Credits,
    order: ReportRequest,
    code: Mapping[str, str],
    trials: Collection[RecordedTrial],
) -> None:
    """Write readme, licence, citation and metadata files."""
    terrains = list(dict.fromkeys(trial.terrain for trial in trials))
    terrain_order = list(order.terrains)
    choices = {"version": FORMAT, "seed": order.seed, "terrains": terrain_order}
    texts = {
        ANALYSIS: json.dumps(choices, indent=1) + "\n",
        "environment.txt": _environment(code),
        "datacite.json": datacite_json(about),
        "CITATION.cff": citation_cff(about),
        "LICENSE.md": licence_text(about),
        "README.md": readme_text(about, terrains, len(trials)),
    }
    for name, text in texts.items():
        write_new(to / name, text.encode())


def _copy_session(session: SessionFolder, to: Path) -> SessionFolder:
    """Copy the recordings of a session, in line with its journal.

    Links out of the session are not copied.
    """
    copy = replace(session, path=to / session.path.name)
    for name in _FOLDERS:
        source, target = session.path / name, copy.path / name
        target.mkdir(parents=True, exist_ok=True)
        for path in list_folder(source):
            if path.name.endswith(_LEFT) or path.is_dir():
                continue
            with reading(path), os.fdopen(open_data(path), "rb") as file:
                content = file.read()
            write_new(target / path.name, content)
    derive(copy, replay(copy.events()))
    return copy


def _credits(
    trials: Collection[RecordedTrial], request: PublishRequest, software: str
) -> Credits:
    terrains = ", ".join(dict.fromkeys(trial.terrain for trial in trials))
    is_simulated = any(trial.is_simulated for trial in trials)
    kind = "Simulated trials" if is_simulated else "Trials"
    count = f"{len(trials)} {kind.lower()}"
    return Credits(
        title=request.title or f"{kind} of a robotic foot on {terrains}",
        description=request.description
        or f"{count} of a robotic foot pushed across {terrains}: joint positions and "
        "wrist force at 500 Hz, friction models and their errors on trials left out.",
        authors=request.authors,
        licence=request.licence,
        date=iso_utc(SystemClock().utc_ns())[:10],
        software=software,
    )


def _recording(to: Path, path: Path, trial: RecordedTrial) -> RecordingAction:
    about, code = trial.metadata["trial"], trial.metadata["provenance"]
    folder = path.parent.parent
    settings = [folder / name for name in _SETTINGS if (folder / name).is_file()]
    results = [path, path.with_suffix(".json")]
    return RecordingAction(
        name=trial.name,
        terrain=trial.terrain,
        operator=about.get("operator", ""),
        started_utc=about.get("started_utc", ""),
        seconds=float(trial.t[-1]),
        software=code.get("software", "traction"),
        commit=code.get("commit", "unknown"),
        settings=[str(file.relative_to(to)) for file in settings],
        results=[str(file.relative_to(to)) for file in results],
    )


def _environment(code: Mapping[str, str]) -> str:
    """Return code version and installed packages, one per line."""
    packages = sorted(
        {
            f"{package.metadata['Name']}=={package.version}"
            for package in metadata.distributions()
        },
        key=str.lower,
    )
    return "\n".join(
        [*(f"# {name}: {value}" for name, value in code.items()), *packages, ""]
    )


def _say(to: Path, trials: Collection[RecordedTrial], console: Console) -> None:
    names = sorted({t.metadata["trial"].get("operator", "") for t in trials} - {""})
    console.say(
        f"{counted(len(trials), 'trial')} published in {to}; checksums in {SUMS}."
    )
    if names:
        console.say(
            f"{WARNING} The recordings name who pushed: {', '.join(names)}. Do they "
            "agree to be published?"
        )
    console.say(f"To check: traction verify {to}; to compute again: add --rebuild.")
