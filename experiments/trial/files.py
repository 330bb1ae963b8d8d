"""What is written of a recorded trial: the sealed file, its sidecar, the flight."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import TrialFileError
from acquisition.trial_file import TrialHeader, VerifiedFile
from analysis.data import CoverageGrid, suggest
from experiments.rig import Rig
from experiments.session import (
    KEEP,
    TrialName,
    TrialOutcome,
    read_json,
    sidecar_of,
    write_json,
)
from experiments.trial.header import SessionMetadata, write_flight, write_truth
from experiments.trial.quality import Review

CELLS = (4, 4)  # speeds, loads of a coverage
MANY = 1_000_000_000  # samples, more than any trial has


@dataclass(frozen=True, slots=True)
class TrialArchive:
    """The files of one session's trials."""

    rig: Rig
    metadata: SessionMetadata

    def seal(self, header: TrialHeader, name: TrialName, reason: str) -> VerifiedFile:
        """End and verify the trial file, and the truth beside it when simulated.

        Raises:
            TrialFileError: a file could not be written or verified.
        """
        verified = self.rig.backend.recorder.finish(reason)
        truth = self.metadata.folder.trials / f"{name.kept}.truth.mcap"
        write_truth(self.rig, header, truth)
        return verified

    def flight(self, header: TrialHeader, name: TrialName, reason: str) -> str:
        """Write the flight record of a fault; return what to say about it."""
        path = self.metadata.folder.faults / f"{name.rejected}.flight.mcap"
        try:
            write_flight(self.rig, header, path, reason)
        except TrialFileError as error:
            return f"No flight record: {error}"
        return f"Flight record: faults/{path.name}."

    def write_sidecar(
        self,
        name: TrialName,
        verified: VerifiedFile,
        outcome: TrialOutcome,
        review: Review | None = None,
    ) -> None:
        """Write what is known of a sealed trial beside it, without a verdict.

        Args:
            name: the attempt.
            verified: what reading the file back has shown.
            outcome: how the recording ended.
            review: what the trial is worth; None = not looked at.

        Raises:
            TrialFileError: the disk is full or gone.
        """
        details = sidecar_of(name, verified, outcome)
        if review is not None:
            details |= {"ratio": review.known_ratio, "coverage": review.counts.tolist()}
        write_json(self.metadata.folder.trials / f"{name.kept}.json", details)

    def kept_ratios(self) -> list[float]:
        """Return the quick fits of the trials kept so far, from their sidecars."""
        ratios = (sidecar.get("ratio") for sidecar in self._kept_sidecars())
        return [ratio for ratio in ratios if isinstance(ratio, float)]

    def suggestion(self) -> str:
        """Return how the next push should be, so that the kept ones leave no gap."""
        counts = np.zeros(CELLS, np.int64)
        for sidecar in self._kept_sidecars():
            counts += cells_of(sidecar.get("coverage"))
        return suggest(CoverageGrid(counts))

    def _kept_sidecars(self) -> list[dict[str, Any]]:
        paths = sorted(self.metadata.folder.trials.glob("T*.json"))
        sidecars = [read_json(path) for path in paths]
        return [sidecar for sidecar in sidecars if sidecar.get("verdict") == KEEP]


def cells_of(value: object) -> NDArray[np.int64]:
    """Return a coverage as it stands in a sidecar, zeros where it is none."""
    try:
        counts = np.array(value, np.int64)
    except (ValueError, TypeError, OverflowError):
        counts = np.zeros(0, np.int64)
    is_map = counts.shape == CELLS and bool((counts >= 0).all() & (counts < MANY).all())
    return counts if is_map else np.zeros(CELLS, np.int64)
