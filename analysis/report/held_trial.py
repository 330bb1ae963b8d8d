"""What a report holds of a recorded trial: the arrays of its file are let go.

A trial in arrays has 660 bytes for each of its cycles, a report of hundreds of trials
needs 32 of them: time, velocity and two forces. All else that needs the arrays is found
while they are there, and they are read again where something is asked for later.
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
class HeldTrial:
    """A recorded trial without the arrays of its file.

    Attributes:
        path: the file.
        metadata: metadata by name.
        series: velocity and forces over time.
        frame: where the container stood.
        payload: calibration and tare that were applied.
        bracket: the tares before and after it; None where one is not known.
        doubts: why it cannot be that of a foot that is pushed along x_T.
        health: of the rig, without what the tares of its session tell.
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
    def of(cls, trial: RecordedTrial) -> "HeldTrial":
        """Return what is held of a trial."""
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
    """Recorded trials on disk: one after the other is read, every time anew."""

    def __init__(self, trials: Sequence[HeldTrial]) -> None:
        self._paths = [trial.path for trial in trials]

    def __iter__(self) -> Iterator[RecordedTrial]:
        """Give every trial in arrays."""
        return map(load_trial, self._paths)
