import numpy as np
import pytest

from analysis.data.quality import (
    ENOUGH,
    CoverageGrid,
    coverage,
    quick_ratio,
    thinnest,
)


class Trial:
    """The kept samples of a trial."""

    def __init__(self, v_t, F_n, F_t=None):
        self.v_t, self.F_n = np.array(v_t, float), np.array(F_n, float)
        self.F_t = np.array(F_n if F_t is None else F_t, float)


def test_samples_are_counted_by_speed_and_load():
    found = coverage([Trial([0.005, 0.02, 0.3], [1.0, 3.0, 20.0]), Trial([0.1], [7.0])])
    expected = np.zeros((4, 4), int)
    for cell in ((0, 0), (1, 1), (3, 3), (2, 2)):
        expected[cell] = 1
    assert (found.counts == expected).all()
    assert found.fast_share == 0.25


def test_speed_counts_in_both_directions():
    assert coverage([Trial([-0.3], [1.0])]).counts[3, 0] == 1


def test_the_thinnest_reachable_cell_is_reported():
    counts = np.full((4, 4), 100)
    counts[1, 2], counts[2, 1] = 1, 2
    assert thinnest(CoverageGrid(counts)) == "slower than 0.05 m/s, above 5 N"


FEW = round(1000 * ENOUGH)  # of a thousand samples


@pytest.mark.parametrize(("held", "is_thin"), [(FEW - 1, True), (FEW, False)])
def test_a_cell_below_its_share_of_samples_is_thin(held, is_thin):
    counts = np.zeros((4, 4), int)
    for cell in ((1, 1), (2, 1), (2, 2), (0, 1), (0, 2)):
        counts[cell] = 100
    counts[1, 2], counts[3, 0] = held, 1000 - 500 - held
    assert (thinnest(CoverageGrid(counts)) != "") is is_thin


def test_no_cell_is_thin_if_all_reachable_cells_are_covered():
    assert thinnest(CoverageGrid(np.full((4, 4), 100))) == ""


def test_unreachable_cells_are_not_thin():
    counts = np.full((4, 4), 100)
    counts[3, 3] = counts[0, 0] = 0
    assert thinnest(CoverageGrid(counts)) == ""


def test_without_a_trial_no_cell_is_thin():
    assert thinnest(coverage([])) == ""


def test_the_quick_ratio_is_the_slope_of_traction_over_load():
    assert quick_ratio(Trial([0, 0], [2.0, 4.0], [1.0, 2.0])) == pytest.approx(0.5)
    assert np.isnan(quick_ratio(Trial([0], [0.0])))
