"""The caption of the coverage map lists the sparse cells of speed and load."""

from analysis.data.quality import coverage, thinnest
from analysis.report.results import compute_results
from analysis.report.sections.beyond_paper.coverage import caption_coverage


def test_the_sparse_cell_of_every_terrain_is_reported(small_study):
    caption = caption_coverage(compute_results(small_study))
    cells = {
        name: thinnest(coverage(result.trials))
        for name, result in small_study.terrains.items()
    }
    thin = [f"{name} {words}" for name, words in cells.items() if words]
    assert thin
    assert caption.endswith(f" Below 2% of its samples: {'; '.join(thin)}.")
