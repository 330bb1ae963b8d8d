"""What the ground gives before it goes: models of break-away beside the pushes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.breakaway.model import BREAK_AWAY, BreakAwayModel
from analysis.breakaway.pushes import FootPush, find_pushes
from analysis.breakaway.survival import SurvivalCurve, kaplan_meier, pit_limit
from analysis.data.series import Array
from analysis.study.models import GP_SE
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult
from analysis.terrains.export import break_away_of

RISKS = (0.05, 0.1, 0.5)  # at which forces are stated
BREAK_AWAY_UNITS = {
    "law": "log N (sliding: N), 1, log N, log N",
    "v_slip": "m/s",
    "F_n, loads, forces, available, in_motion": "N",
    "pushes": "peak N, F_n N, held",
}
_POINTS = 60  # of a curve


@dataclass(frozen=True, slots=True)
class TerrainBreakAway:
    """A terrain's break-away model and the pushes that it was fitted to.

    Attributes:
        terrain: name of the terrain.
        title: its name with its kind in words.
        model: the fit of all trials.
        pushes: of all trials, in order.
        motion: mean and standard deviation [N] of F_t at the slowest velocity of the
            window and the median load; None without a Gaussian process.
    """

    terrain: str
    title: str
    model: BreakAwayModel
    pushes: tuple[FootPush, ...]
    motion: tuple[float, float] | None

    @property
    def peaks(self) -> Array:
        """Peaks of the pushes [N], shape (n,)."""
        return np.array([push.peak for push in self.pushes])

    @property
    def F_n(self) -> Array:
        """Their normal forces [N], shape (n,)."""
        return np.array([push.F_n for push in self.pushes])

    @property
    def is_held(self) -> np.ndarray:
        """Which of them held, shape (n,)."""
        return np.array([push.is_held for push in self.pushes], dtype=bool)

    @property
    def load(self) -> float:
        """Median F_n of the pushes, or the middle of the model's range [N]."""
        return float(np.median(self.F_n if self.pushes else self.model.loads))

    @property
    def loads(self) -> Array:
        """Normal forces of curves [N], over the range that is not extrapolated."""
        return np.linspace(*self.model.loads, _POINTS)

    @property
    def forces(self) -> Array:
        """Traction forces of curves [N], from zero to beyond every peak."""
        most = max([self.model.forces[1], *self.peaks.tolist()])
        return np.linspace(0.0, most, _POINTS)

    @property
    def survival(self) -> SurvivalCurve | None:
        """Kaplan and Meier's curve of the peaks; None without a slip."""
        if self.is_held.all():
            return None
        return kaplan_meier(self.peaks, self.is_held)

    @property
    def mean_risk(self) -> Array:
        """The model's risk at `forces`, mean over the loads of the pushes."""
        risks = [
            self.model.risks(np.full(self.F_n.size, force), self.F_n)
            for force in self.forces
        ]
        return np.array([float(np.mean(risk)) for risk in risks])

    @property
    def limit(self) -> float | None:
        """Distance from Kaplan and Meier's curve that chance exceeds in 5 %."""
        if self.model.kind != BREAK_AWAY:
            return None
        return pit_limit(self.model.slips)

    def motion_quantile(self, share: float) -> float | None:
        """Return the force in motion [N] that is not reached with that probability."""
        from scipy.special import ndtri

        if self.motion is None:
            return None
        return self.motion[0] + self.motion[1] * float(ndtri(share))

    def numbers(self) -> dict[str, Any]:
        """Return what is stated of the terrain as plain values, for fits.json."""
        model = self.model
        available = [model.available(self.load, risk) for risk in RISKS]
        return {
            **{k: v for k, v in model.to_dict().items() if k != "draws"},
            "F_n": self.load,
            "available": [
                {"risk": risk, "force": a.force, "low": a.low, "high": a.high}
                for risk, a in zip(RISKS, available, strict=True)
            ],
            "in_motion": {str(risk): self.motion_quantile(risk) for risk in RISKS},
            "limit": self.limit,
            "pushes": [
                [push.peak, push.F_n, float(push.is_held)] for push in self.pushes
            ],
        }


def break_away_findings(
    study: Study, models: Mapping[str, BreakAwayModel] | None = None
) -> Mapping[str, TerrainBreakAway]:
    """Return what every terrain gives before it slips, where that is known.

    Args:
        study: the trials.
        models: fitted to them by terrain; None = they are fitted here.
    """
    models = break_away_of(study) if models is None else models
    return {
        name: _of_terrain(study.terrains[name], model, study.options.prepare.slowest)
        for name, model in models.items()
    }


def _of_terrain(
    result: TerrainResult, model: BreakAwayModel, slowest: float
) -> TerrainBreakAway:
    pushes = tuple(
        push
        for trial in result.trials
        if trial.kept
        for push in find_pushes(trial, model.v_slip)
    )
    quiet = TerrainBreakAway(result.terrain, result.title, model, pushes, None)
    folds = result.models(GP_SE)
    if not folds:
        return quiet
    found = folds[0].model.predict(np.array([quiet.load]), np.array([slowest]))
    motion = (float(found.mean[0]), float(found.sd[0]))
    return TerrainBreakAway(result.terrain, result.title, model, pushes, motion)
