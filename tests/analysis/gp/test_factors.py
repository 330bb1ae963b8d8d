"""Grain sizes and further factors in the process of all ground."""

import numpy as np
import pytest

from analysis.gp.ground import Ground, GroundRows, Resemblance, left_out, terms_of
from analysis.gp.hierarchy import GroundLikelihood, GroundPosterior, names_of, prior_of

PAPER = (
    Ground("S0", "small", 0.0, (("foot", "tread"),)),
    Ground("B15", "big", 15.0, (("foot", "tread"),)),
    Ground("TF", "flat", 0.0, (("foot", "tread"),)),
    Ground("Tf", "flat", 0.0, (("foot", "bare"),)),
)


def ground(name, size, incline=0.0, **factors):
    return Ground(name, size, incline, tuple(factors.items()))


MIXED = (
    ground("a", "12 mm", 0.0, moisture="dry", load=1.0),
    ground("b", "small", 10.0, moisture="wet", load=2.0),
    ground("c", "big", -10.0, moisture="dry", load=4.0),
    ground("d", "55 mm", 0.0, moisture="wet", load=1.0),
    ground("P", "flat", 0.0, moisture="dry", load=1.0),
)


def rows(grounds, seed=0, per_trial=3):
    rng, count = np.random.default_rng(seed), 3 * per_trial * len(grounds)
    index = np.repeat(np.arange(len(grounds)), 3 * per_trial)
    trial = np.repeat(np.arange(3 * len(grounds)), per_trial)
    X, y = rng.normal(size=(count, 2)), rng.normal(size=count)
    return GroundRows(X, y, index, trial, grounds)


def test_the_papers_grounds_have_no_further_factor():
    # foot tells plates apart, which are like themselves only
    assert terms_of(PAPER) == ()


def test_a_factor_that_varies_has_one_hyperparameter():
    terms = terms_of(MIXED)
    assert names_of(terms)[14:] == ("logit_rho_moisture", "log_lambda_load")
    assert prior_of(1.0, terms)[0][14:] == pytest.approx([1.0, 0.7])
    assert terms_of(MIXED[:1]) == ()
    alike = tuple(g._replace(factors=MIXED[0].factors) for g in MIXED)
    assert terms_of(alike) == ()


def test_six_factors_are_taken_and_the_others_named():
    names = [f"f{k}" for k in range(8)]
    many = tuple(
        ground(f"g{k}", "small", **{n: float(k + i) for i, n in enumerate(names)})
        for k in range(3)
    )
    assert [term.name for term in terms_of(many)] == names[:6]
    assert left_out(many) == ("f6", "f7")


def test_the_gradient_of_further_factors_agrees_with_differences():
    terms, data = terms_of(MIXED), rows(MIXED)
    likelihood = GroundLikelihood(data, data.inputs, terms)
    centre = prior_of(1.0, terms)[0]
    theta = centre + np.random.default_rng(1).normal(0.0, 0.3, centre.size)
    slope = likelihood(theta)[1]
    h = 1e-5
    for k, step in enumerate(h * np.eye(theta.size)):
        change = likelihood(theta + step)[0] - likelihood(theta - step)[0]
        assert slope[k] == pytest.approx(change / (2 * h), rel=1e-6, abs=1e-6)


def test_grain_sizes_of_the_paper_are_as_far_apart_as_before():
    theta = prior_of(1.0)[0]
    T = Resemblance(PAPER[:2], PAPER[:2]).at(theta)[0]
    rho, own = 1.0 / (1.0 + np.exp(-theta[8:10]))
    far = np.exp(-0.5 * 15.0**2 / np.exp(2.0 * theta[7]))
    expected = np.exp(2.0 * theta[3]) * (1.0 - own) * far * rho
    assert T[0, 1] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("sizes", "correlation"),
    [(("10 mm", "small"), 0.74), (("small", "80 mm"), 0.51), (("2 mm", "small"), 0.35)],
)
def test_correlation_falls_with_the_ratio_of_sizes(sizes, correlation):
    theta = prior_of(1.0)[0]
    theta[9] = -30.0  # nothing of its own
    some = [ground(size, size) for size in sizes]
    T = Resemblance(some, some).at(theta)[0]
    assert T[0, 1] / T[0, 0] == pytest.approx(correlation, abs=0.006)


def test_every_design_has_a_positive_covariance():
    rng = np.random.default_rng(5)
    for _ in range(300):
        some = tuple(
            ground(
                f"g{k}",
                f"{rng.uniform(2.0, 80.0):.3g} mm",
                float(rng.integers(-2, 3) * 10),
                moisture=str(rng.choice(["dry", "wet", "ice"])),
                load=float(rng.integers(1, 4)),
            )
            for k in range(int(rng.integers(3, 15)))
        )
        terms = terms_of(some)
        mean, sd = prior_of(1.0, terms)
        T = Resemblance(some, some, terms).at(rng.normal(mean, sd))[0]
        assert np.linalg.eigvalsh(T).min() > -1e-9 * np.abs(T).max()


def test_a_ground_of_which_a_factor_does_not_apply_is_its_own():
    lone = ground("x", "small", 10.0, moisture=None, load=2.0)
    some = (*MIXED[:4], lone)
    T = Resemblance(some, some, terms_of(some)).at(prior_of(1.0, terms_of(some))[0])[0]
    assert T[4, :4] == pytest.approx(0.0)
    assert T[4, 4] == pytest.approx(T[0, 0])


def test_a_size_between_recorded_ones_is_known_better_than_one_outside():
    size = [12.0, 19.0, 37.0]
    some = tuple(ground(f"g{d:g}", f"{d:g} mm") for d in size)
    data = rows(some, seed=3, per_trial=12)
    level = np.log(np.array(size))[data.ground]
    data = GroundRows(data.inputs, level + data.y / 10, data.ground, data.trial, some)
    model = GroundPosterior(data).climbed().given(data)
    between, outside, far = (
        model.predict(ground("n", f"{d} mm"), np.zeros((1, 2))).latent[0]
        for d in (26, 60, 400)
    )
    assert between < outside < far
