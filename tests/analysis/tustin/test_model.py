import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from acquisition.errors import SettingsError
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.samples import SampleTable
from analysis.tustin.bootstrap import bootstrap_tustin
from analysis.tustin.box_least_squares import solve_in_box
from analysis.tustin.identifiability import correlation_samples
from analysis.tustin.model import (
    NO_STRIBECK,
    NOT_IDENTIFIABLE,
    TustinBounds,
    TustinForm,
    TustinParameters,
    bound,
    fit_tustin,
    predict,
)
from analysis.tustin.moments import Moments, search, solve_moments, zoom
from analysis.tustin.varpro import Problem, polish

TENTHS = st.integers(-50, 50).map(lambda number: number / 10)
PLAIN = TustinParameters(mu=0.6, F_s=9.0, v_s=0.04, delta_s=1.2, b=6.0)


@pytest.fixture
def samples(vectors):
    case = vectors["tustin"]
    return [np.array(case[key]) for key in ("F_n", "v_t", "F_t")]


@pytest.fixture
def stones(slice_trials):
    trials = [prepare_trial(series, PrepareOptions()) for series in slice_trials["S0"]]
    return SampleTable.of(trials)


def test_equation_one_has_the_reference_values(vectors):
    case = vectors["tustin"]["value_at"]
    found = predict(
        TustinParameters(*case["p"]), np.array(case["F_n"]), np.array(case["v_t"])
    )
    np.testing.assert_allclose(found, case["F_t"], rtol=1e-14)


def test_the_model_is_odd_in_velocity():
    F_n, v = np.array([2.0, 5.0]), np.array([0.01, 0.3])
    np.testing.assert_allclose(predict(PLAIN, F_n, -v), -predict(PLAIN, F_n, v))


def test_the_force_at_rest_is_the_static_friction():
    assert predict(PLAIN, np.array([2.0]), np.array([0.0]))[0] == 9.0


def test_signs_of_the_papers_rows_are_taken_literally():
    # Table I, small stones: the exponential is about e^-1 at any speed
    row = TustinParameters(mu=0.71, F_s=13.52, v_s=-0.841, delta_s=-0.017, b=-23.4)
    found = predict(row, np.array([3.0]), np.array([0.05]))
    e = np.exp(-((0.05 / 0.841) ** -0.017))
    assert found[0] == pytest.approx(0.71 * 3 * (1 - e) + 13.52 * e - 23.4 * 0.05)


def test_a_very_steep_exponent_does_not_overflow():
    row = TustinParameters(mu=0.843, F_s=0.534, v_s=0.079, delta_s=420.0, b=7.49)
    found = predict(row, np.array([1.0, 1.0]), np.array([0.07, 0.2]))
    np.testing.assert_allclose(found, [0.534 + 7.49 * 0.07, 0.843 + 7.49 * 0.2])


def test_sticking_holds_the_larger_of_static_and_sliding_force():
    np.testing.assert_allclose(bound(PLAIN, np.array([5.0, 20.0])), [9.0, 12.0])
    printed = bound(PLAIN, np.array([5.0, 20.0]), as_printed=True)
    np.testing.assert_allclose(printed, [3.0, 12.0])


def test_linear_parameters_and_error_have_the_reference_values(vectors, samples):
    case = vectors["tustin"]["profile_at"]
    problem = Problem(samples, TustinBounds().box())
    point = problem.project(np.log([case["v_s"], case["delta"]])).point
    np.testing.assert_allclose(point.p, case["mu_Fs_b"], rtol=1e-8)
    assert point.sse == pytest.approx(case["sse"], rel=1e-12)


@pytest.mark.parametrize("is_proportional", [False, True])
@pytest.mark.parametrize("b_upper", [200.0, 3.0])
def test_gradient_of_the_search_agrees_with_differences(
    samples, b_upper, is_proportional
):
    box = TustinBounds(b=(-200.0, b_upper)).box()
    weights = np.linspace(0.5, 2.0, samples[0].size)
    problem = Problem(samples, box, is_proportional=is_proportional, weights=weights)
    q, h = np.log([0.05, 1.5]), 1e-5
    slope = problem.project(q).slope
    for k, step in enumerate(h * np.eye(2)):
        ahead, behind = (problem.project(q + s).point for s in (step, -step))
        # central difference: error of order h^2, rounding 1e-15/h
        assert slope[k] == pytest.approx((ahead.sse - behind.sse) / (2 * h), rel=1e-6)


def test_fit_reaches_the_reference_optimum(vectors, samples):
    case = vectors["tustin"]["optimum"]
    fit = fit_tustin(*samples)
    assert fit.sse == pytest.approx(case["sse"], rel=1e-9)
    found = fit.parameters
    values = [found.mu, found.F_s, found.v_s, found.delta_s, found.b]
    np.testing.assert_allclose(values, case["p"], rtol=1e-4)
    assert fit.flags == ()


def test_known_parameters_are_recovered_without_noise():
    rng = np.random.default_rng(5)
    F_n, v = rng.uniform(2, 10, 400), rng.uniform(0.005, 0.2, 400)
    fit = fit_tustin(F_n, v, predict(PLAIN, F_n, v))
    found = fit.parameters
    assert found.mu == pytest.approx(0.6, rel=1e-3)
    assert found.v_s == pytest.approx(0.04, rel=1e-3)
    assert fit.rmse < 1e-4


def test_no_start_of_an_independent_solver_does_better(stones):
    from scipy.optimize import least_squares

    box = TustinBounds()
    pairs = np.array([pair for _, pair in box.items()])
    lower, upper = pairs.T
    is_log = np.array([False, False, True, True, False])

    def natural(x):
        return np.where(is_log, np.exp(np.where(is_log, x, 0.0)), x)

    def residual(x):
        return predict(TustinParameters(*natural(x)), rows.F_n, rows.v_t) - rows.F_t

    rows = stones.take(np.arange(0, stones.count, 4))
    low = np.where(is_log, np.log(np.where(is_log, lower, 1.0)), lower)
    high = np.where(is_log, np.log(np.where(is_log, upper, 1.0)), upper)
    rng = np.random.default_rng(2)
    best = min(
        2 * least_squares(residual, rng.uniform(low, high), bounds=(low, high)).cost
        for _ in range(20)
    )
    ours = fit_tustin(rows.F_n, rows.v_t, rows.F_t).sse
    assert ours <= best * (1 + 1e-6)


def test_no_other_step_velocity_does_better():
    rng = np.random.default_rng(119)
    F_n, v = rng.uniform(2, 10, 60), np.exp(rng.uniform(-5.3, -1.6, 60))
    step = TustinParameters(mu=0.6, F_s=9.0, v_s=0.04, delta_s=20.0, b=6.0)
    F_t = predict(step, F_n, v) + rng.normal(0, 2.0, 60)
    problem = Problem((F_n, v, F_t), TustinBounds().box())
    # an optimum is 1/20 wide, a cell of the grid 0.46
    steps = [np.array([x, np.log(20.0)]) for x in np.linspace(-5.3, -1.6, 400)]
    best = min(problem.project(q).point.sse for q in steps)
    assert fit_tustin(F_n, v, F_t).sse <= best


def test_a_parameter_on_its_bound_is_flagged(stones):
    box = TustinBounds(v_s=(0.05, 1.0))
    fit = fit_tustin(stones.F_n, stones.v_t, stones.F_t, box)
    assert fit.parameters.v_s == pytest.approx(0.05)
    assert "v_s at lower bound" in fit.flags
    assert "v_s at upper bound" not in fit.flags
    assert ("b negative" in fit.flags) is (fit.parameters.b < 0)


def test_a_straight_line_is_flagged_as_having_no_stribeck_shape():
    rng = np.random.default_rng(1)
    F_n, v = rng.uniform(2, 10, 400), rng.uniform(0.005, 0.2, 400)
    noise = rng.normal(0, 0.3, 400)
    straight = fit_tustin(F_n, v, 0.5 * F_n + 1.0 + 5.0 * v + noise)
    curved = fit_tustin(F_n, v, predict(PLAIN, F_n, v) + noise)
    assert NO_STRIBECK in straight.flags
    assert NO_STRIBECK not in curved.flags


def test_static_friction_can_be_proportional_to_load():
    rng = np.random.default_rng(8)
    F_n, v = rng.uniform(2, 10, 400), rng.uniform(0.005, 0.2, 400)
    form = TustinForm(static="proportional")
    true = TustinParameters(mu=0.5, F_s=1.4, v_s=0.04, delta_s=1.2, b=6.0)
    fit = fit_tustin(F_n, v, predict(true, F_n, v, form), form=form)
    assert fit.parameters.F_s == pytest.approx(1.4, rel=1e-3)
    assert fit.mean(np.array([2.0]), np.array([0.0]))[0] == pytest.approx(2.8, rel=1e-3)
    np.testing.assert_allclose(bound(true, np.array([3.0]), form), [4.2])


@pytest.mark.parametrize("loss", ["huber", "student"])
def test_outliers_do_not_bias_a_robust_fit(loss):
    rng = np.random.default_rng(9)
    F_n, v = rng.uniform(2, 10, 600), rng.uniform(0.005, 0.2, 600)
    clean = predict(PLAIN, F_n, v)
    F_t = clean + rng.normal(0, 0.1, 600)
    F_t[::12] += 40.0
    plain = fit_tustin(F_n, v, F_t)
    robust = fit_tustin(F_n, v, F_t, form=TustinForm(loss=loss))
    # 8 % of wild samples shift a mean by 3.3 N
    assert np.abs(plain.mean(F_n, v) - clean).mean() > 2.0
    assert np.abs(robust.mean(F_n, v) - clean).mean() < 0.15


def test_a_force_that_falls_with_load_is_flagged_as_nonphysical():
    rng = np.random.default_rng(10)
    F_n, v = rng.uniform(2, 10, 300), rng.uniform(0.005, 0.2, 300)
    F_t = 9.0 - 0.5 * F_n + 3.0 * v + rng.normal(0, 0.05, 300)
    box = TustinBounds(mu=(-5.0, 5.0), F_s=(-60.0, 60.0))
    flags = fit_tustin(F_n, v, F_t, box).flags
    assert "mu negative" in flags
    assert "b negative" not in flags


def test_a_profile_of_a_clear_curve_closes_and_contains_the_truth():
    rng = np.random.default_rng(12)
    F_n, v = rng.uniform(2, 10, 3000), np.exp(rng.uniform(-5.3, -1.6, 3000))
    fit = fit_tustin(F_n, v, predict(PLAIN, F_n, v) + rng.normal(0, 0.2, 3000))
    found = fit.profiles
    assert found.v_s.lower <= 0.04 * 1.3  # a step of the profile is 1.33
    assert found.v_s.upper >= 0.04 / 1.3
    assert found.are_closed
    assert NOT_IDENTIFIABLE not in fit.flags


def test_a_profile_of_a_straight_line_stays_open():
    rng = np.random.default_rng(13)
    F_n, v = rng.uniform(2, 10, 600), rng.uniform(0.005, 0.2, 600)
    fit = fit_tustin(F_n, v, 0.5 * F_n + 1.0 + 5.0 * v + rng.normal(0, 0.3, 600))
    assert not fit.profiles.are_closed
    assert NOT_IDENTIFIABLE in fit.flags


def test_binned_sums_give_the_error_of_the_samples(stones):
    problem = Problem((stones.F_n, stones.v_t, stones.F_t), TustinBounds().box())
    moments = Moments.of(problem, (stones.count,))
    q = np.log([[0.001, 0.44], [0.05, 1.5], [0.3, 10.0]])
    _, sse = solve_moments(moments.sums[0], moments.v, q, problem.box)
    exact = [problem.project(point).point.sse for point in q]
    # bins of 2 % of velocity
    np.testing.assert_allclose(sse, exact, rtol=1e-3)


def test_the_search_converges_in_a_convex_bowl():
    bottoms = np.array([[-4.0, 0.7], [-5.1, 1.3]])
    box = np.array([[-7.0, 0.0], [-2.0, 3.0]])

    def sse(q):
        return np.sum((q - bottoms[:, None]) ** 2, axis=-1)

    start = np.add(bottoms, [[0.3, -0.2], [-0.1, 0.25]])
    found = zoom(sse, start, np.full(2, 0.4), box)
    # eight halvings of 0.4; half of the last step is left
    np.testing.assert_allclose(found, bottoms, atol=0.4 / 2**7)
    outside = zoom(lambda q: q[..., 0] ** 2, np.full((2, 2), -1.0), np.ones(2), box - 3)
    assert outside[:, 0].max() <= -3.0


def test_a_start_near_a_known_optimum_is_abandoned(stones):
    problem = Problem((stones.F_n, stones.v_t, stones.F_t), TustinBounds().box())
    best = search(problem, Moments.of(problem, (stones.count,)))[0]
    start = np.add(best.q, 0.3)
    alone, left = polish(problem, start), polish(problem, start, [best])
    assert alone.sse == pytest.approx(best.sse, rel=1e-9)
    assert best.sse * (1 + 1e-9) < left.sse <= best.sse * 1.001


def test_the_bootstrap_resamples_trials_and_contains_the_truth():
    rng = np.random.default_rng(14)
    trials = []
    for shift in rng.normal(0, 0.3, 10):  # common to the rows of a trial
        F_n, v = rng.uniform(2, 10, 200), np.exp(rng.uniform(-5.3, -1.6, 200))
        F_t = predict(PLAIN, F_n, v) + shift + rng.normal(0, 0.1, 200)
        trials.append((F_n, v, F_t))
    fit = fit_tustin(*(np.concatenate(column) for column in zip(*trials, strict=True)))
    found = bootstrap_tustin(trials, fit, np.random.default_rng(0), draws=100)
    for name, ends in found.items():
        assert ends.lower <= getattr(fit.parameters, name) <= ends.upper
        assert ends.lower <= getattr(PLAIN, name) <= ends.upper
    # the shift of a trial has sd 0.3 N: over ten, F_s is known to about 2 x 0.1 N
    assert 0.1 < found["F_s"].upper - found["F_s"].lower < 2.0


def test_the_same_draws_give_the_same_intervals(stones):
    half = stones.count // 2
    columns = (stones.F_n, stones.v_t, stones.F_t)
    trials = [tuple(c[:half] for c in columns), tuple(c[half:] for c in columns)]
    fit = fit_tustin(*columns)
    once, again = (
        bootstrap_tustin(trials, fit, np.random.default_rng(3), draws=10)
        for _ in range(2)
    )
    assert once == again


def test_parameters_stay_inside_narrow_bounds(samples):
    box = TustinBounds(mu=(0.0, 0.5), b=(-1.0, 1.0))
    found = fit_tustin(*samples, box)
    assert found.parameters.mu <= 0.5
    assert found.parameters.b == pytest.approx(1.0)
    assert "b at upper bound" in found.flags


def test_a_constant_load_is_fitted():
    rng = np.random.default_rng(3)
    v = rng.uniform(0.005, 0.2, 200)
    F_t = predict(PLAIN, np.full(200, 5.0), v)
    assert fit_tustin(np.full(200, 5.0), v, F_t).rmse < 1e-3


def test_too_few_samples_are_refused():
    few = np.full(19, 0.1)
    with pytest.raises(SettingsError, match="19 samples are too few"):
        fit_tustin(few, few, few)


@pytest.mark.parametrize("choice", [{"mu": (1.0, 1.0)}, {"v_s": (0.0, 1.0)}])
def test_invalid_bounds_are_refused(choice):
    with pytest.raises(SettingsError, match="are no range"):
        TustinBounds(**choice)


@settings(max_examples=60, deadline=None)
@given(
    arrays(np.float64, (8, 3), elements=TENTHS),
    arrays(np.float64, 8, elements=TENTHS),
)
def test_the_box_solution_is_never_worse_than_scipys(A, y):
    from scipy.optimize import lsq_linear

    lower, upper = np.array([0.0, -1.0, -0.5]), np.array([1.0, 2.0, 0.5])
    p = solve_in_box(A.T @ A, A.T @ y, lower, upper)
    assert np.all((p >= lower) & (p <= upper))
    ours = np.sum((A @ p - y) ** 2)
    other = np.sum((A @ lsq_linear(A, y, (lower, upper)).x - y) ** 2)
    # the ridge of 1e-12 moves collinear solutions by about 1e-9
    assert ours <= other + 1e-6 * (1.0 + other)


def test_the_correlation_time_of_a_known_process_is_found():
    rng = np.random.default_rng(0)
    x = np.zeros(200_000)
    kicks = rng.normal(size=x.size)
    for k in range(1, x.size):
        x[k] = 0.9 * x[k - 1] + kicks[k]
    # (1 + 0.9)/(1 - 0.9) = 19; the cut at 0.05 loses a twentieth of it
    assert correlation_samples(x) == pytest.approx(19.0, rel=0.1)


def test_white_noise_has_one_sample_of_correlation():
    noise = np.random.default_rng(0).normal(size=5000)
    assert correlation_samples(noise) == 1.0
