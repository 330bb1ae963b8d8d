"""What becomes of a recorded trial: sealed, kept or rejected, with its sidecar."""

from dataclasses import dataclass

from acquisition.errors import TrialFileError
from acquisition.trial_file.verify import Verified
from acquisition.trial_file.writer import TrialHeader
from experiments.rigs import Rig
from experiments.store import iso_utc, move_file, read_json, write_json
from experiments.trial import SessionFacts, TrialName, write_flight, write_truth

COMPLETE = frozenset({"travel", "key", "time-limit"})
ENOUGH = 0.9  # share of the container a trial has to cross


@dataclass(slots=True)
class Outcome:
    """How a recording ended.

    Attributes:
        reason: "travel", "key", "time-limit", "interrupted" or a fault's name.
        seconds: since the start [s].
        displacement: of the foot along the container [m].
    """

    reason: str
    seconds: float = 0.0
    displacement: float = 0.0

    @property
    def status(self) -> str:
        """The machine's word on the trial, never a verdict."""
        return "complete" if self.reason in COMPLETE else "interrupted"


@dataclass(frozen=True, slots=True)
class Archive:
    """The files of one session's trials."""

    rig: Rig
    facts: SessionFacts

    def seal(self, header: TrialHeader, name: TrialName, reason: str) -> Verified:
        """End and verify the trial file, and the truth beside it when simulated.

        Raises:
            TrialFileError: a file could not be written or verified.
        """
        verified = self.rig.crew.recorder.finish(reason)
        truth = self.facts.folder.trials / f"{name.kept}.truth.mcap"
        write_truth(self.rig, header, truth)
        return verified

    def flight(self, header: TrialHeader, name: TrialName, reason: str) -> str:
        """Write the flight record of a fault; return what to say about it."""
        path = self.facts.folder.faults / f"{name.rejected}.flight.mcap"
        try:
            write_flight(self.rig, header, path, reason)
        except TrialFileError as error:
            return f"No flight record: {error}"
        return f"Flight record: faults/{path.name}."

    def sidecar(
        self, name: TrialName, verified: Verified, outcome: Outcome
    ) -> dict[str, object]:
        """Return the sidecar of a sealed trial, without a verdict."""
        return {
            "trial": name.kept,
            "attempt": name.attempt,
            "sha256": verified.sha256,
            "size": verified.size,
            "cycles": verified.cycles,
            "duration": round(verified.duration, 3),
            "worst_gap": round(verified.worst_gap, 6),
            "status": outcome.status,
            "stop_reason": outcome.reason,
            "displacement": round(outcome.displacement, 4),
            "verdict": "",
            "reason": "",
            "who": self.facts.operator,
            "when": "",
            "history": [],
        }

    def kept_ratios(self) -> list[float]:
        """Return the quick fits of the trials kept so far, from their sidecars."""
        found: list[float] = []
        for path in sorted(self.facts.folder.trials.glob("T*.json")):
            ratio = read_json(path).get("ratio")
            if isinstance(ratio, float):
                found.append(ratio)
        return found

    def keep(self, name: TrialName, sidecar: dict[str, object]) -> None:
        """Write the verdict `keep` beside the trial."""
        sidecar.update(verdict="keep", when=iso_utc(self.rig.clock.utc_ns()))
        write_json(self.facts.folder.trials / f"{name.kept}.json", sidecar)

    def reject(self, name: TrialName, sidecar: dict[str, object], why: str) -> None:
        """Move the trial to rejected/ with the verdict and its reason."""
        when = iso_utc(self.rig.clock.utc_ns())
        sidecar.update(verdict="reject", reason=why, when=when)
        folder = self.facts.folder
        for suffix in (".mcap", ".truth.mcap"):
            source = folder.trials / f"{name.kept}{suffix}"
            if source.exists():
                move_file(source, folder.rejected / f"{name.rejected}{suffix}")
        write_json(folder.rejected / f"{name.rejected}.json", sidecar)
