"""Results of a study shared by all sections of a report.

A section computes its own numbers from `StudyResults`; `of` caches them, so that table,
figure, caption and fits.json agree.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

from analysis.report.sections.rig_health.health import RigTrial
from analysis.report.surfaces import (
    CoverageMap,
    Surface,
    SurfaceAxes,
    cell_edges,
    coverages,
    surface_axes,
    surfaces,
)
from analysis.study.models import GP_SE
from analysis.study.study import Study
from analysis.terrains.identify import Identification, identify_study

Numbers = TypeVar("Numbers")


@dataclass(frozen=True, eq=False)
class StudyResults:
    """A study and derived results used by more than one section.

    Attributes:
        study: the study.
        identification: terrain classification; None for one terrain.
        axes: axes of the surfaces.
        surfaces: surfaces of the Gaussian process.
        edges: cell edges of `coverage`.
        coverage: coverage of velocity and load by the samples.
        rig: health of the rig by trial; empty for external data.
    """

    study: Study
    identification: Identification | None
    axes: SurfaceAxes
    surfaces: Sequence[Surface]
    edges: SurfaceAxes
    coverage: Sequence[CoverageMap]
    rig: Sequence[RigTrial]

    def of(self, compute: "Callable[[StudyResults], Numbers]") -> Numbers:
        """Return `compute` of these results, computed once and cached."""
        if compute not in self._computed:
            from threadpoolctl import threadpool_limits

            with threadpool_limits(1):  # threads are slower for small matrices
                self._computed[compute] = compute(self)
        return self._computed[compute]

    @cached_property
    def _computed(self) -> dict[Callable[..., Any], Any]:  # not a field: derived
        return {}


def compute_results(study: Study, rig: Sequence[RigTrial] = ()) -> StudyResults:
    """Compute the shared results of a study without fitting models.

    Args:
        study: the study.
        rig: health of the rig by trial.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # threads are slower for small matrices
        axes, edges = surface_axes(study), cell_edges(study)
        return StudyResults(
            study=study,
            identification=identify_study(study),
            axes=axes,
            surfaces=surfaces(study, GP_SE, axes),
            edges=edges,
            coverage=coverages(study, edges),
            rig=rig,
        )
