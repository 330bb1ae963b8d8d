"""The quality gate: what a trial is worth, while the terrain can still be seen."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.events import find_slips
from analysis.load import load_trial
from analysis.prepare import PrepareOptions, prepare
from experiments.console import GOOD, WARNING

JOINT7_WARNING = 0.020  # rad
MIN_KEPT = 250


@dataclass(frozen=True, slots=True)
class Review:
    """Numbers of one trial for the review page.

    Attributes:
        worst_gap: longest time between two cycles [s].
        missed: cycles that are missing.
        joint7: largest motion of joint 7 [rad].
        kept: samples inside the analysis window.
        slips: number of slips.
        ratio: median F_t / F_n while moving with F_n > 1 N; NaN if there is none.
    """

    worst_gap: float
    missed: int
    joint7: float
    kept: int
    slips: int
    ratio: float

    def lines(self) -> list[tuple[str, str]]:
        """Return (mark, text) of every line."""
        timing = GOOD if self.worst_gap < 0.004 and not self.missed else WARNING
        joint7 = GOOD if self.joint7 < JOINT7_WARNING else WARNING
        kept = GOOD if self.kept >= MIN_KEPT else WARNING
        ratio = "-" if np.isnan(self.ratio) else f"{self.ratio:.2f}"
        return [
            (
                timing,
                f"timing worst gap {self.worst_gap * 1e3:.1f} ms, missed {self.missed}",
            ),
            (joint7, f"joint 7 moved {self.joint7 * 1e3:.0f} mrad"),
            (
                kept,
                f"kept {self.kept} samples · slips {self.slips} · "
                f"median F_t/F_n {ratio}",
            ),
        ]


def review_trial(path: Path) -> Review:
    """Return what the finished file says about the trial.

    Raises:
        TrialFileError: it cannot be read.
    """
    trial = load_trial(path)
    prepared = prepare(
        trial.series(), PrepareOptions(container_travel=trial.frame.travel)
    )
    q7 = trial.cycles["position"][:, 6]
    loaded = prepared.F_n > 1.0
    ratio = (
        float(np.median(prepared.F_t[loaded] / prepared.F_n[loaded]))
        if bool(loaded.any())
        else float("nan")
    )
    steps = np.diff(trial.cycles["cycle"].astype(int))
    return Review(
        worst_gap=float(np.diff(trial.t).max()),
        missed=int((steps - 1).sum()),
        joint7=float(np.abs(q7 - q7[0]).max()),
        kept=int(prepared.kept),
        slips=len(find_slips(prepared.smooth)),
        ratio=ratio,
    )
