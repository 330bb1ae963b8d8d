import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import SquaredExponential
from analysis.gp.noise import ConstantNoise, LogLinearNoise
from analysis.gp.proposals import bounds, moves
from analysis.gp.search import (
    Search,
    climb_from,
    is_hopeless,
    maximise_posterior,
    posterior_search,
)

SE = SquaredExponential(2)
ROWS = np.random.default_rng(0).normal(size=(40, 2))
KERNELS = {
    "se": SE,
    "nn": Arcsine(2),
    "printed": Arcsine(2, as_printed=True),
    "sum": SE + Arcsine(2),
    "product": Arcsine(2) * SE,
}


class Hills:
    """A likelihood with hills of given centre, height and width.

    `rough`: likelihood of a subset of the rows; `hole`: where it is undefined.
    """

    kernel, noise, trials = SE, ConstantNoise(), None
    X, r = ROWS, ROWS[:, 0] / ROWS[:, 0].std()

    def __init__(self, *tops, rough=None, hole=lambda theta: False):
        self.tops, self.rough, self.hole = tops, rough, hole

    def __call__(self, theta):
        if self.hole(theta):
            raise SettingsError("none")
        total, slope = 0.0, np.zeros(theta.size)
        for centre, height, width in self.tops:
            step = (theta - centre) / width
            part = height * np.exp(-0.5 * step @ step)
            total, slope = total + part, slope - part * step / width
        return total - 1e-3 * theta @ theta, slope - 2e-3 * theta

    def value(self, theta):
        return self(theta)[0]

    def thinned(self, most):
        return self if self.rough is None else self.rough


def test_a_search_starts_at_the_best_point_on_a_subset():
    goal = np.log([0.1, 3.5] * ROWS.std(axis=0))
    rough = Hills((np.array([0.0, *goal, 0.0]), 5.0, 1.0))
    optimum = maximise_posterior(Hills((np.zeros(4), 5.0, 1.0), rough=rough))
    np.testing.assert_allclose(optimum.start_points[0][1:3], goal)


def test_a_move_finds_an_optimum_that_the_first_start_misses():
    low = np.array([0.0, -1.0, 0.5, -0.5])
    high = low + np.array([0.0, 0.0, 2.5, 0.0])  # one length apart
    # a subset of the rows shows only the lower top
    both = Hills((low, 5.0, 0.6), (high, 9.0, 0.6), rough=Hills((low, 5.0, 0.6)))
    optimum = maximise_posterior(both)
    np.testing.assert_allclose(optimum.theta[1:3], high[1:3], atol=0.1)
    assert [start.lml > 8 for start in optimum.starts[:2]] == [False, True]
    assert climb_from(both, optimum.start_points[:1]).lml < 6


@pytest.mark.parametrize("length", [0.5, 5.5])
def test_a_new_start_is_far_from_known_optima(length):
    search = Search(Hills((np.array([0.0, -1.0, length, -0.5]), 5.0, 3.0)))
    search.climb(search.designed_start())
    search.move()
    optimum = search.optimum()
    # lengths beyond e^4 standard deviations are equivalent
    known = np.minimum([optimum.starts[0].theta, optimum.start_points[0]], 4.0)
    for moved in optimum.start_points[1:]:
        gaps = np.abs(known - np.minimum(moved, 4.0))[:, 1:3]
        assert gaps.max(axis=1).min() >= 1.0


@pytest.mark.parametrize("apart", [-0.35, 0.35])
def test_a_neighbouring_optimum_is_found(apart):
    low = np.array([0.0, -1.0, 0.5, -0.5])
    high = low + np.array([0.0, apart, 0.0, 0.0])
    both = Hills((low, 5.0, 0.15), (high, 5.1, 0.15))
    assert climb_from(both, [low]).theta[1] == pytest.approx(low[1], abs=0.05)
    optimum = climb_from(both, [low], is_searched=True)
    assert optimum.theta[1] == pytest.approx(high[1], abs=0.05)


def test_no_neighbour_is_searched_along_an_inactive_length():
    top = np.array([0.0, 5.5, 5.5, -0.5])
    optimum = climb_from(Hills((top, 5.0, 3.0)), [top], is_searched=True)
    gaps = np.abs(
        np.array(optimum.start_points[1:])[:, 1:3] - optimum.starts[0].theta[1:3]
    )
    assert gaps.max(axis=1).min() >= 1.0


def test_a_climb_near_a_known_optimum_is_abandoned():
    top = np.array([0.0, -1.0, 0.5, -0.5])
    hill = Hills((top, 5.0, 2.0))
    alone = [climb_from(hill, [start]) for start in (top + 0.7, top - 0.7)]
    both = climb_from(hill, [top + 0.7, top - 0.7])
    assert both.lml == alone[0].lml
    assert 5.0 - both.starts[1].lml < 0.2
    assert both.starts[1].evaluations < alone[1].starts[0].evaluations


def test_a_climb_to_a_much_lower_optimum_is_abandoned():
    best, low = np.array([0.0, -2.0, 0.5, -0.5]), np.array([0.0, 2.0, 0.5, -0.5])
    hills = Hills((best, 9.0, 0.8), (low, 4.0, 1.0))
    alone = climb_from(hills, [low + 0.7])
    both = climb_from(hills, [best + 0.1, low + 0.7])
    assert both.lml == pytest.approx(9.0, abs=0.1)
    assert both.starts[1].lml < alone.lml
    assert both.starts[1].evaluations < alone.starts[0].evaluations


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ((-9.0, -9.0, -9.0), False),  # too few steps
        ((-9.0, -9.0, -9.0, -9.0), True),
        ((-9.0, -8.0, -5.0, -4.0), False),  # gains more than it lacks
        ((-9.0, -9.0, -4.2, -4.1, -4.0, -4.0), True),  # gained before
        ((-0.4, -0.4, -0.4, -0.4), False),  # near the best
        ((0.0, 1.0, 1.0, 1.0), False),  # above the best
    ],
)
def test_a_climb_is_hopeless_far_below_the_best_without_gain(values, expected):
    assert is_hopeless(values, 0.0) is expected


def test_points_without_a_likelihood_are_not_starts():
    optimum = maximise_posterior(
        Hills((np.zeros(4), 5.0, 1.0), hole=lambda x: x[1] < -1)
    )
    assert all(start[1] >= -1 for start in optimum.start_points)


def test_hyperparameters_at_a_bound_of_the_search_are_reported():
    edge = bounds(SE, 1.0, ROWS.std(axis=0))[2, 1]
    optimum = maximise_posterior(
        Hills((np.array([0.0, 0.0, edge + 1.0, 0.0]), 9.0, 2.0))
    )
    assert optimum.at_bound == ("log_l2",)


@pytest.mark.parametrize("name", list(KERNELS))
@pytest.mark.parametrize("noise", [ConstantNoise(), LogLinearNoise(2)])
@pytest.mark.parametrize("rows", [10, 40])
def test_every_kernel_is_searched_from_one_start_and_its_moves(name, noise, rows):
    X, kernel = ROWS[:rows], KERNELS[name]
    y = np.sin(X[:, 0]) + np.random.default_rng(1).normal(0, 0.1, rows)
    optimum = posterior_search(kernel, noise, X, y)
    assert len(optimum.starts) == len(optimum.start_points)
    theta = optimum.theta[: len(kernel.names)]
    assert 1 <= len(optimum.starts) <= 2 + len(moves(kernel, theta))
    assert optimum.lml == max(start.lml for start in optimum.starts)
    again = posterior_search(kernel, noise, X, y)
    np.testing.assert_array_equal(again.theta, optimum.theta)


@pytest.mark.parametrize("dimensions", [1, 3])
def test_kernels_of_other_dimensions_are_searched_too(dimensions):
    X = np.random.default_rng(2).normal(size=(40, dimensions))
    y = np.sin(2 * X[:, 0]) + np.random.default_rng(3).normal(0, 0.1, 40)
    for kernel in (SquaredExponential(dimensions), Arcsine(dimensions)):
        optimum = posterior_search(kernel, ConstantNoise(), X, y)
        # better than a constant with the outputs' own spread
        assert optimum.lml > -0.5 * 40 * (1 + np.log(2 * np.pi * y.var())) + 10


def test_an_input_that_does_not_vary_is_searched():
    X = ROWS * [1.0, 0.0]
    optimum = posterior_search(SE, ConstantNoise(), X, np.sin(X[:, 0]))
    assert np.isfinite(optimum.lml)


def test_an_input_with_a_long_length_is_tried_as_inactive():
    """For a trend the best optimum may be at an infinite length."""
    low = np.array([0.0, -1.0, 1.5, -0.5])
    bound = bounds(SE, 1.0, ROWS.std(axis=0))[2, 1]
    high = np.array([0.0, -1.0, bound, -0.5])
    optimum = maximise_posterior(
        Hills((low, 9.0, 0.8), (high, 9.5, 0.8), (high, 1.0, 3.0))
    )
    np.testing.assert_allclose(optimum.theta[2], bound, atol=0.2)


def test_moves_of_a_sum_are_those_of_one_part_at_a_time():
    theta = np.arange(7.0)
    kinds = moves(SE + Arcsine(2), theta)
    left_moves, right_moves = moves(SE, theta[:3]), moves(Arcsine(2), theta[3:])
    assert len(kinds) == len(left_moves) + len(right_moves)
    for kind, alone in zip(kinds, [*left_moves, *right_moves], strict=True):
        is_left = len(alone[0]) == 3
        moved, kept = (slice(0, 3), slice(3, 7)) if is_left else (slice(3, 7), slice(3))
        np.testing.assert_array_equal(np.array(kind)[:, moved], alone)
        assert np.all(np.array(kind)[:, kept] == theta[kept])
