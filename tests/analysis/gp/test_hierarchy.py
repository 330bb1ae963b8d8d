"""One process over several grounds: against differences, closed form, drawn forces."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp.ground import Ground, GroundRows, Resemblance
from analysis.gp.hierarchy import NAMES, GroundLikelihood, GroundPosterior, prior_of

GROUNDS = (
    Ground("S0", "small", 0.0),
    Ground("S10", "small", 10.0),
    Ground("B15", "big", 15.0),
    Ground("TF", "flat", 0.0),
    Ground("Tf", "flat", 0.0),
)
CENTRE = prior_of(1.0)[0]


def drawn(per_trial=4, trials=3, seed=0):
    """Return random rows of three trials on each of five grounds."""
    rng, count = np.random.default_rng(seed), per_trial * trials * len(GROUNDS)
    ground = np.repeat(np.arange(len(GROUNDS)), per_trial * trials)
    trial = np.repeat(np.arange(trials * len(GROUNDS)), per_trial)
    X, y = rng.normal(size=(count, 2)), rng.normal(size=count)
    return GroundRows(X, y, ground, trial, GROUNDS)


def covariance(rows, theta):
    """Return what the rows' covariance is by its definition, element by element."""
    value = dict(zip(NAMES, np.exp(theta), strict=True))
    rho, own = (
        value[k] / (1.0 + value[k]) for k in ("logit_rho", "logit_own")
    )  # exp of a logit is the odds
    n, X = rows.y.size, rows.inputs
    C = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            g, h = rows.grounds[rows.ground[i]], rows.grounds[rows.ground[j]]
            gap = (X[i] - X[j]) ** 2
            lengths = np.array([value["log_l1"], value["log_l2"]])
            C[i, j] = value["log_s0"] ** 2 * np.exp(-0.5 * (gap / lengths**2).sum())
            if g.is_plate is h.is_plate:
                T = float(g == h)
                if not g.is_plate:
                    far = (g.incline_deg - h.incline_deg) / value["log_la"]
                    near = np.exp(-0.5 * far**2) * (1.0 if g.size == h.size else rho)
                    T = (1.0 - own) * near + own * T
                kind = "plate" if g.is_plate else "stones"
                lengths = np.array([value["log_m1"], value["log_m2"]])
                deviates = value[f"log_A_{kind}"] ** 2 * T
                C[i, j] += deviates * np.exp(-0.5 * (gap / lengths**2).sum())
                if rows.trial[i] == rows.trial[j]:
                    C[i, j] += value[f"log_sc_{kind}"] ** 2
                C[i, j] += value[f"log_sn_{kind}"] ** 2 * (i == j)
    return C


def test_gradient_agrees_with_differences():
    rows = drawn()
    likelihood = GroundLikelihood(rows, rows.inputs)
    theta = CENTRE + np.random.default_rng(1).normal(0.0, 0.3, CENTRE.size)
    slope = likelihood(theta)[1]
    h = 1e-5  # the error of a central difference is of order h^2
    for k, step in enumerate(h * np.eye(theta.size)):
        change = likelihood(theta + step)[0] - likelihood(theta - step)[0]
        assert slope[k] == pytest.approx(change / (2 * h), rel=1e-6, abs=1e-6), NAMES[k]


def test_likelihood_has_the_closed_form_of_its_covariance():
    from scipy.stats import multivariate_normal

    rows = drawn(per_trial=2)
    theta = CENTRE + np.random.default_rng(2).normal(0.0, 0.3, CENTRE.size)
    expected = multivariate_normal(np.zeros(rows.y.size), covariance(rows, theta))
    value = GroundLikelihood(rows, rows.inputs)(theta)[0]
    assert value == pytest.approx(expected.logpdf(rows.y), rel=1e-9)


def test_posterior_adds_the_normal_priors():
    rows = drawn(per_trial=2)
    posterior = GroundPosterior(rows)
    mean, sd = prior_of(1.0)
    moved = mean + 0.5 * sd
    centred = GroundRows(
        *(rows.inputs, rows.y - posterior.offset, rows.ground, rows.trial, GROUNDS)
    )
    X = (rows.inputs - posterior.centre) / posterior.scale
    bare = GroundLikelihood(centred, X)(moved)[0]
    assert posterior(moved)[0] == pytest.approx(bare - 0.5 * 0.25 * mean.size)


@pytest.mark.parametrize("index", [1, 3])
def test_prediction_has_the_closed_form_of_conditioning(index):
    rows = drawn(per_trial=2)
    process = GroundPosterior(rows).climbed(dict(zip(NAMES, CENTRE, strict=True)))
    inputs = np.random.default_rng(3).normal(size=(3, 2))
    predicted = process.given(rows).predict(GROUNDS[index], inputs)
    # the three points as a further trial of that ground, their noise taken off
    both = GroundRows(
        np.vstack([rows.inputs, inputs]),
        np.concatenate([rows.y, np.zeros(3)]),
        np.concatenate([rows.ground, np.full(3, index)]),
        np.concatenate([rows.trial, [90, 91, 92]]),
        GROUNDS,
    )
    standard = (both.inputs - process.centre) / process.scale
    both = GroundRows(standard, both.y, both.ground, both.trial, GROUNDS)
    C, n = covariance(both, process.theta), rows.y.size
    gain = np.linalg.solve(C[:n, :n], C[:n, n:]).T
    mean = process.offset + gain @ (rows.y - process.offset)
    spread = np.diag(C[n:, n:] - gain @ C[:n, n:])
    assert predicted.mean == pytest.approx(mean, rel=1e-8)
    total = predicted.latent + predicted.noise + predicted.between
    assert total == pytest.approx(spread, rel=1e-8)


def test_stones_resemble_each_other_less_the_further_their_inclines_differ():
    theta = CENTRE.copy()
    B, _ = Resemblance(GROUNDS, GROUNDS).at(theta)
    steep = Ground("S30", "small", 30.0)
    near, far = Resemblance(GROUNDS[:1], [GROUNDS[1], steep]).at(theta)[0][0]
    assert B[0, 0] > near > far > 0.0


def test_plates_resemble_nothing_but_themselves():
    B, _ = Resemblance(GROUNDS, GROUNDS).at(CENTRE)
    assert B[3, 3] > 0.0
    assert np.count_nonzero(B[3]) == np.count_nonzero(B[4]) == 1


def test_an_incline_between_two_known_ones_is_predicted_from_them():
    """Forces rise with the incline; nothing of ten degrees is known."""
    rng = np.random.default_rng(4)
    grounds = tuple(Ground(f"S{a:g}", "small", a) for a in (0.0, 5.0, 15.0, 20.0))
    ground, trial = np.repeat(np.arange(4), 30), np.repeat(np.arange(12), 10)
    X = rng.uniform(1.0, 8.0, (120, 2))
    angle = np.array([g.incline_deg for g in grounds])[ground]
    level = rng.normal(0.0, 0.3, 12)[trial]
    y = 0.8 * X[:, 0] + 0.3 * angle + level + rng.normal(0.0, 0.3, 120)
    rows = GroundRows(X, y, ground, trial, grounds)
    process = GroundPosterior(rows).climbed()
    told = process.given(rows).predict(Ground("S10", "small", 10.0), X[:20])
    error = told.mean - (0.8 * X[:20, 0] + 3.0)
    assert np.abs(error).max() < 4.0 * np.sqrt(told.latent.max()) < 3.0
    assert np.abs(error).mean() < 0.6  # against 1.5 from one incline to the next


def test_one_row_is_no_model():
    rows = drawn()
    one = GroundRows(
        rows.inputs[:1], rows.y[:1], rows.ground[:1], rows.trial[:1], GROUNDS
    )
    with pytest.raises(SettingsError):
        GroundPosterior(one)
