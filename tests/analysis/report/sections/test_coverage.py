"""The caption of the coverage map names the thin cells of speed and load."""

from analysis.data.quality import coverage, thinnest
from analysis.report.results import compute_results
from analysis.report.sections.beyond_paper.coverage import caption_coverage


def test_the_thin_cell_of_every_terrain_is_named(small_study):
    caption = caption_coverage(compute_results(small_study))
    found = {
        name: thinnest(coverage(result.trials))
        for name, result in small_study.terrains.items()
    }
    thin = [f"{name} {words}" for name, words in found.items() if words]
    assert thin
    assert caption.endswith(f" Below 2% of its samples: {'; '.join(thin)}.")
