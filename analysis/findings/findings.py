"""Everything a report shows, computed once for tables, figures and files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.findings.rig_health import RigTrial
from analysis.findings.surfaces import (
    CoverageMap,
    Surface,
    SurfaceAxes,
    cell_edges,
    coverages,
    surface_axes,
    surfaces,
)
from analysis.findings.trends import (
    NoiseSummary,
    ResidualBand,
    Trend,
    noise_summaries,
    residual_band,
    trends_of,
)
from analysis.study import GP_SE, TUSTIN, Study
from analysis.terrains import Identification, identify_study

RESIDUAL_MODELS = (TUSTIN, GP_SE)


@dataclass(frozen=True, slots=True)
class StudyResults:
    """A study and what follows from it.

    Attributes:
        study: the study.
        identification: how well the terrains can be told apart; None for one terrain.
        noise: constant against chosen noise, by terrain.
        trends: of the trial means, by terrain and measure.
        residuals: by terrain and model.
        axes: of the surfaces.
        surfaces: of the Gaussian process.
        edges: of the cells of `coverage`.
        coverage: of velocity and load by the samples.
        rig: health of the rig by trial; empty for tables from elsewhere.
    """

    study: Study
    identification: Identification | None
    noise: Sequence[NoiseSummary]
    trends: Mapping[str, Mapping[str, Trend]]
    residuals: Mapping[str, Mapping[str, ResidualBand]]
    axes: SurfaceAxes
    surfaces: Sequence[Surface]
    edges: SurfaceAxes
    coverage: Sequence[CoverageMap]
    rig: Sequence[RigTrial]


def compute_results(study: Study, rig: Sequence[RigTrial] = ()) -> StudyResults:
    """Return what follows from a study; models are only asked, nothing is fitted."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # small matrices: more threads lose time
        return _compute(study, rig)


def _compute(study: Study, rig: Sequence[RigTrial]) -> StudyResults:
    results, axes, edges = study.terrains, surface_axes(study), cell_edges(study)
    return StudyResults(
        study=study,
        identification=identify_study(study),
        noise=noise_summaries(study),
        trends={name: trends_of(result) for name, result in results.items()},
        residuals={
            name: {
                model: band
                for model in RESIDUAL_MODELS
                if (band := residual_band(result, model)) is not None
            }
            for name, result in results.items()
        },
        axes=axes,
        surfaces=surfaces(study, GP_SE, axes),
        edges=edges,
        coverage=coverages(study, edges),
        rig=rig,
    )
