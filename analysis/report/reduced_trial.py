"""Reduced form of a recorded trial for reports, without the arrays of its file.

A loaded trial takes 660 bytes per cycle; a report of hundreds of trials needs only 32:
time, velocity and two forces. Everything else that needs the arrays is computed while
they are loaded; they are read again when something needs them later.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from analysis.data.load import RecordedTrial, load_trial
from analysis.data.plausibility import Doubt, doubts_of_record
from analysis.data.series import TractionSeries
from analysis.data.tare_bracket import TareBracket
from analysis.report.sections.rig_health.health import RigTrial, health_of
from ft_sensor.payload import Payload, TerrainFrame


@dataclass(frozen=True, slots=True, eq=False)
class ReducedTrial:
    """A recorded trial without the arrays of its file.

    Attributes:
        path: the file.
        metadata: metadata by name.
        series: velocity and forces over time.
        frame: pose of the container.
        payload: applied calibration and tare.
        bracket: tares before and after the trial; None if one is not known.
        doubts: results of the plausibility checks of the recording.
        health: health of the rig, without the results from the session's tares.
    """

    path: Path
    metadata: dict[str, dict[str, str]]
    series: TractionSeries
    frame: TerrainFrame
    payload: Payload
    bracket: TareBracket | None
    doubts: Sequence[Doubt]
    health: RigTrial

    @property
    def name(self) -> str:
        """Session and trial, e.g. S012/T04."""
        return self.series.name

    @property
    def terrain(self) -> str:
        """Name of the terrain."""
        return self.series.terrain

    @classmethod
    def of(cls, trial: RecordedTrial) -> "ReducedTrial":
        """Reduce a trial."""
        return cls(
            path=trial.path,
            metadata=trial.metadata,
            series=trial.series(),
            frame=trial.frame,
            payload=trial.payload,
            bracket=trial.bracket,
            doubts=doubts_of_record(trial),
            health=health_of(trial),
        )


class TrialFiles:
    """Iterable over recorded trials that reads each from disk on every pass."""

    def __init__(self, trials: Sequence[ReducedTrial]) -> None:
        self._paths = [trial.path for trial in trials]

    def __iter__(self) -> Iterator[RecordedTrial]:
        """Load every trial."""
        return map(load_trial, self._paths)
