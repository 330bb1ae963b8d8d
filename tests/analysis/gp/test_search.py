import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import SquaredExponential
from analysis.gp.noise import ConstantNoise, LogLinearNoise
from analysis.gp.search import StartScores, maximise, posterior_search

SE = SquaredExponential(2)
MODEL = (SE, ConstantNoise())
ROWS = np.random.default_rng(0).normal(size=(40, 2))
KERNELS = {
    "se": SE,
    "nn": Arcsine(2),
    "printed": Arcsine(2, as_printed=True),
    "sum": SE + Arcsine(2),
    "product": Arcsine(2) * SE,
}


def hill(*tops):
    """Return a likelihood with a top of given height and width at every theta."""

    def objective(theta):
        total, slope = 0.0, np.zeros(theta.size)
        for place, height, width in tops:
            step = (theta - place) / width
            part = height * np.exp(-0.5 * step @ step)
            total, slope = total + part, slope - part * step / width
        return total - 1e-3 * theta @ theta, slope - 2e-3 * theta

    return objective


def search(objective, rough=None):
    def exact(theta):
        return objective(theta)[0]

    scores = StartScores(rough or exact, exact)
    return maximise(MODEL, objective, ROWS, 1.0, scores)


def test_search_begins_at_the_most_promising_point_and_far_from_it():
    objective = hill((np.array([0.0, 1.0, -1.0, 0.0]), 5.0, 1.0))
    first, second, third = search(objective).began
    offered = np.array(SE.design(1.0, ROWS.std(axis=0)))
    heights = [objective(np.append(point, second[-1]))[0] for point in offered]
    np.testing.assert_array_equal(first[:-1], offered[np.argmax(heights)])
    # lengths offered differ by factors of 2.9 to 3.5: two of them are 1.5 apart
    assert np.abs(second - first).max() >= 1.5
    assert np.abs(third - first).max() > 0


def test_first_starts_follow_the_rough_score():
    objective = hill((np.zeros(4), 5.0, 1.0))
    goal = np.log([0.1, 3.5] * ROWS.std(axis=0))
    optimum = search(objective, rough=lambda theta: -np.abs(theta[1:3] - goal).sum())
    np.testing.assert_allclose(optimum.began[0][1:3], goal)


def test_last_start_finds_a_top_that_the_others_miss():
    low = np.array([0.0, -1.0, 0.5, -0.5])
    high = low + np.array([0.0, 0.0, 2.5, 0.0])  # one length apart
    # rough: all that a part of the rows knows of is the lower top
    optimum = search(
        hill((low, 5.0, 0.6), (high, 9.0, 0.6)),
        rough=lambda theta: -np.abs(theta - low).sum(),
    )
    np.testing.assert_allclose(optimum.theta[1:3], high[1:3], atol=0.1)
    assert [start.lml > 8 for start in optimum.starts] == [False, False, True]


@pytest.mark.parametrize("length", [0.5, 5.5])
def test_a_last_start_is_far_from_known_tops(length):
    optimum = search(hill((np.array([0.0, -1.0, length, -0.5]), 5.0, 3.0)))
    tops = np.array([start.theta for start in optimum.starts[:2]])
    # lengths beyond e^3 standard deviations are all the same
    gaps = np.minimum(tops, 3.0) - np.minimum(optimum.began[2], 3.0)
    assert np.abs(gaps)[:, 1:3].max(axis=1).min() >= 1.0


def test_points_without_a_likelihood_are_no_starts():
    plain = hill((np.zeros(4), 5.0, 1.0))

    def objective(theta):
        if theta[1] < -1:
            raise SettingsError("none")
        return plain(theta)

    optimum = search(objective)
    assert len(optimum.starts) == 3
    assert all(start[1] >= -1 for start in optimum.began)


@pytest.mark.parametrize("name", list(KERNELS))
@pytest.mark.parametrize("noise", [ConstantNoise(), LogLinearNoise(2)])
@pytest.mark.parametrize("rows", [10, 40])
def test_every_kernel_is_searched_from_three_starts_or_four(name, noise, rows):
    X, kernel = ROWS[:rows], KERNELS[name]
    y = np.sin(X[:, 0]) + np.random.default_rng(1).normal(0, 0.1, rows)
    optimum = posterior_search((kernel, noise), X, y)
    assert len(optimum.starts) == len(optimum.began)
    assert len(optimum.starts) in {3, 4}
    assert optimum.lml == max(start.lml for start in optimum.starts)
    again = posterior_search((kernel, noise), X, y)
    np.testing.assert_array_equal(again.theta, optimum.theta)


@pytest.mark.parametrize("dimensions", [1, 3])
def test_kernels_of_other_dimensions_are_searched_too(dimensions):
    X = np.random.default_rng(2).normal(size=(40, dimensions))
    y = np.sin(2 * X[:, 0]) + np.random.default_rng(3).normal(0, 0.1, 40)
    for kernel in (SquaredExponential(dimensions), Arcsine(dimensions)):
        optimum = posterior_search((kernel, ConstantNoise()), X, y)
        # a constant of the outputs' own spread explains nothing
        assert optimum.lml > -0.5 * 40 * (1 + np.log(2 * np.pi * y.var())) + 10


def test_an_input_that_does_not_vary_is_searched():
    X = ROWS * [1.0, 0.0]
    optimum = posterior_search(MODEL, X, np.sin(X[:, 0]))
    assert np.isfinite(optimum.lml)


def test_moves_of_a_sum_are_those_of_one_part_at_a_time():
    kernel = SE + Arcsine(2)
    theta = np.arange(7.0)
    moves = np.array(kernel.moves(theta))
    np.testing.assert_array_equal(moves[:, :3], SE.moves(theta[:3]))
    np.testing.assert_array_equal(moves[:, 3:], np.tile(theta[3:], (len(moves), 1)))
    assert np.all(np.count_nonzero(moves != theta, axis=1) == 1)


def test_an_input_with_a_long_length_is_tried_switched_off():
    """On a trend the best top may lie where the length is endless."""
    low = np.array([0.0, -1.0, 1.5, -0.5])
    bound = SE.bounds(1.0, ROWS.std(axis=0))[2, 1]
    high = np.array([0.0, -1.0, bound, -0.5])
    optimum = search(hill((low, 9.0, 0.8), (high, 9.5, 0.8), (high, 1.0, 3.0)))
    np.testing.assert_allclose(optimum.theta[2], bound, atol=0.2)
