"""Proposals and bounds of the search follow from a kernel's hyperparameters."""

from dataclasses import dataclass

import numpy as np
import pytest

from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import (
    Composable,
    Hyperparameter,
    Role,
    SquaredExponential,
)
from analysis.gp.noise import ConstantNoise
from analysis.gp.proposals import bounds, initial_points, moves
from analysis.gp.search import posterior_search

SD_X = np.array([2.0, 0.5])
SE, NN = SquaredExponential(2), Arcsine(2)


@dataclass(frozen=True, slots=True)
class Linear(Composable):
    """k = sf^2 x x' for the first input."""

    parameters = (Hyperparameter("log_sf", Role.SIZE),)

    def diagonal(self, theta, X):
        return np.exp(2.0 * theta[0]) * X[:, 0] ** 2

    def over(self, X, X_other=None):
        other = X if X_other is None else X_other

        def at(theta):
            K = np.exp(2.0 * theta[0]) * np.outer(X[:, 0], other[:, 0])
            return K, lambda W: np.array([2.0 * np.vdot(W, K)])

        return at


@pytest.mark.parametrize("kernel", [SE, NN, SE + NN, NN * SE, Linear() + SE])
def test_every_proposal_has_a_value_for_each_hyperparameter(kernel):
    points = initial_points(kernel, 1.5, SD_X)
    box = bounds(kernel, 1.5, SD_X)
    assert box.shape == (len(kernel.parameters), 2)
    for point in points:
        assert (box[:, 0] <= point).all()
        assert (point <= box[:, 1]).all()
        for kind in moves(kernel, point):
            assert all(move.shape == point.shape for move in kind)
            assert all((move != point).any() for move in kind)


def test_parts_of_a_sum_start_with_different_lengths():
    left, right = np.split(initial_points(SE + SE, 1.0, SD_X)[0], 2)
    assert right[1:] - left[1:] == pytest.approx(np.log(3.0))
    assert right[0] == left[0]


def test_the_second_factor_of_a_product_has_no_unit():
    point = initial_points(SE * SE, 7.0, SD_X)[0]
    assert point[3] == pytest.approx(0.0)
    assert bounds(SE * SE, 7.0, SD_X)[3] == pytest.approx([-6.0, 4.0])


def test_a_custom_kernel_is_searched_without_registration():
    X = np.random.default_rng(1).normal(size=(60, 2))
    y = 3.0 * X[:, 0] + np.random.default_rng(2).normal(0, 0.1, 60)
    optimum = posterior_search(Linear(), ConstantNoise(), X, y)
    assert np.exp(optimum.theta[0]) == pytest.approx(3.0, rel=0.2)
