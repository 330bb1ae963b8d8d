"""Outcomes of disturbed trials, on the path that user data take."""

import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from acquisition.errors import TractionError
from acquisition.trial_file.reader import TrialReader
from analysis.data.load import load_trial
from analysis.data.prepare import prepare_trial
from analysis.data.quality import quick_ratio
from analysis.data.series import Array
from analysis.study.models import FitOptions
from analysis.study.study import StudyOptions, run_study
from analysis.tables.loading import load_tables
from experiments.operator.console import GOOD
from experiments.report.external_tables import require_samples
from experiments.run.quality import review_trial
from ft_sensor.calibration.files import payload_to_toml, terrain_to_toml
from tests.attacks.attack import Attack
from tests.disturbances.rewriting import rewrite
from tests.disturbances.rows import (
    RECORDINGS,
    TABLES,
    Outcome,
    Recording,
    RecordingRow,
    TableRow,
)

DATA = Path(__file__).parents[1] / "data"
RECORDED = DATA / "recorded" / "session-1.0.tar.xz"
TRIALS = {"S0": "S0/00", "TF": "TF/05"}


@dataclass(frozen=True, slots=True)
class Observation:
    """Observed outcome of a disturbed trial.

    Attributes:
        outcome: refused or flagged; harmless if there was no message.
        words: text of the message.
        changed: relative change of F_t/F_n; 0 without a ratio.
    """

    outcome: Outcome
    words: str
    changed: float


def disturbance_attacks() -> list[Attack]:
    """All rows of tables and of recordings."""
    return [*map(_table_attack, TABLES), *map(_recording_attack, RECORDINGS)]


def _table_attack(row: TableRow) -> Attack:
    def check(_: Path) -> None:
        _compare(row, see_table(row))

    return Attack(row.name, "fit of a table", _holds(row), check)


def _recording_attack(row: RecordingRow) -> Attack:
    def check(_: Path) -> None:
        with recorded_trial() as source:
            _compare(row, see_recording(row, source))

    return Attack(row.name, "review of a recorded trial", _holds(row), check)


def _holds(row: TableRow | RecordingRow) -> str:
    if isinstance(row.word, float):
        return f"F_t/F_n changes by at most {row.word:.1%}"
    return f"{row.outcome.value}: {row.word}"


def _compare(row: TableRow | RecordingRow, seen: Observation) -> None:
    assert seen.outcome is row.outcome, seen
    if isinstance(row.word, float):
        assert seen.changed <= row.word + 1e-9, seen
    else:
        assert row.word in seen.words, seen


def see_table(row: TableRow) -> Observation:
    """Outcome of a table that `traction fit` reads and checks."""
    with np.load(DATA / "rehearsal_slice.npz") as arrays:
        table = arrays[TRIALS[row.terrain]].astype(float)
    with TemporaryDirectory() as folder:
        try:
            words, ratio = _fitted(Path(folder), row.disturb(table.copy()), row)
        except TractionError as error:
            words = f"{error.message} {error.hint or ''}".replace(f"{folder}/", "")
            return Observation(Outcome.REFUSED, words.strip(), 0.0)
        _, before = _fitted(Path(folder), table, None)
    outcome = Outcome.FLAGGED if words else Outcome.HARMLESS
    return Observation(outcome, words, abs(ratio / before - 1.0))


def _fitted(folder: Path, table: Array, row: TableRow | None) -> tuple[str, float]:
    """(messages about a table, F_t/F_n).

    Raises:
        TractionError: the table is refused.
    """
    if row is not None and row.header:
        path = folder / "table.csv"
        np.savetxt(path, table, delimiter=",", header=row.header, comments="")
    else:
        path = folder / "table.npz"
        np.savez(path, **{"S0/00": table})
    (series,) = next(iter(load_tables([path]).values()))
    options = StudyOptions(fit=FitOptions(models=(), draws=0), n_jobs=1)
    study = run_study({series.terrain: [series]}, options, simulated=False)
    require_samples(study)
    trial = prepare_trial(series, options.prepare)
    return " ".join(study.warnings), quick_ratio(trial)


@contextmanager
def recorded_trial() -> Iterator[Path]:
    """A trial of the recorded session, unpacked."""
    with TemporaryDirectory() as folder:
        with tarfile.open(RECORDED) as archive:
            archive.extractall(folder, filter="data")
        paths = Path(folder).rglob("trials/T*.mcap")
        yield min(path for path in paths if "truth" not in path.name)


def see_recording(row: RecordingRow, source: Path) -> Observation:
    """Outcome of a recorded trial, as shown by the review."""
    trial, before = load_trial(source), review_trial(source)
    recording = row.disturb(
        Recording(
            TrialReader(source).cycles().data.copy(),
            trial.payload,
            trial.frame,
            trial.sole_point,
        )
    )
    attachments = {
        "ft_calibration.toml": payload_to_toml(recording.payload, recording.sole),
        "terrain.toml": terrain_to_toml(trial.terrain, recording.frame, {}),
    }
    with TemporaryDirectory() as folder:
        path = rewrite(
            *(source, Path(folder) / "T01.mcap", recording.cycles),
            {name: text.encode() for name, text in attachments.items()},
        )
        try:
            after = review_trial(path)
        except TractionError as error:
            return Observation(Outcome.REFUSED, error.message, 0.0)
    messages = [text for mark, text in after.lines() if mark != GOOD]
    usual = {_check(text) for mark, text in before.lines() if mark != GOOD}
    new = [text for text in messages if _check(text) not in usual]
    outcome = Outcome.FLAGGED if new else Outcome.HARMLESS
    return Observation(outcome, "; ".join(new), abs(after.ratio / before.ratio - 1.0))


def _check(text: str) -> str:
    """The check of the review that printed `text`: its first word."""
    return text.split(maxsplit=1)[0]
