"""A study and what every section of a report shares of it.

A section computes its own numbers from `StudyResults`; `of` keeps them, so that table,
figure, caption and fits.json state the same.
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
    """A study and what follows from it for more than one section.

    Attributes:
        study: the study.
        identification: how well the terrains can be told apart; None for one terrain.
        axes: of the surfaces.
        surfaces: of the Gaussian process.
        edges: of the cells of `coverage`.
        coverage: of velocity and load by the samples.
        rig: health of the rig by trial; empty for tables from elsewhere.
    """

    study: Study
    identification: Identification | None
    axes: SurfaceAxes
    surfaces: Sequence[Surface]
    edges: SurfaceAxes
    coverage: Sequence[CoverageMap]
    rig: Sequence[RigTrial]

    def of(self, compute: "Callable[[StudyResults], Numbers]") -> Numbers:
        """A section's numbers: what `compute` gives of these results, computed once."""
        if compute not in self._computed:
            from threadpoolctl import threadpool_limits

            with threadpool_limits(1):  # small matrices: more threads lose time
                self._computed[compute] = compute(self)
        return self._computed[compute]

    @cached_property
    def _computed(self) -> dict[Callable[..., Any], Any]:  # no field: it follows
        return {}


def compute_results(study: Study, rig: Sequence[RigTrial] = ()) -> StudyResults:
    """Return what follows from a study; no model is fitted.

    Args:
        study: the study.
        rig: health of the rig by trial.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):  # small matrices: more threads lose time
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
