"""Which noise the folds of a terrain chose, and what it brought."""

from dataclasses import dataclass

from analysis.study.comparison import Paired, compare
from analysis.study.models import GP_SE, GP_SE_NOISE, GpModel
from analysis.study.noise_selection import NAMES
from analysis.study.study import Study, TerrainResult, mean_of


@dataclass(frozen=True, slots=True)
class NoiseSummary:
    """Constant noise beside the noise that was chosen, on trials left out.

    Attributes:
        terrain: its terrain.
        counts: folds that chose each noise, by its name.
        before: NLPD with constant noise [log N], mean over trials.
        after: NLPD with the chosen noise.
        paired: the second minus the first, trial by trial.
    """

    terrain: str
    counts: dict[str, int]
    before: float
    after: float
    paired: Paired


def noise_summaries(study: Study) -> list[NoiseSummary]:
    """Return one summary per terrain that has both models; none if not fitted."""
    found = (_summary(result) for result in study.terrains.values())
    return [summary for summary in found if summary is not None]


def _summary(result: TerrainResult) -> NoiseSummary | None:
    before, after = (result.scores(model, "nlpd") for model in (GP_SE, GP_SE_NOISE))
    paired, means = compare(before, after), (mean_of(before), mean_of(after))
    if paired is None or means[0] is None or means[1] is None:
        return None
    fitted = [fold.model for fold in result.models(GP_SE_NOISE)]
    chosen = [
        model.choice.chosen
        for model in fitted
        if isinstance(model, GpModel) and model.choice is not None
    ]
    counts = {str(name): chosen.count(name) for name in NAMES}
    return NoiseSummary(result.terrain, counts, means[0], means[1], paired)
