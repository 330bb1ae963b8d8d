"""Functions of JAX: the same answers, pure, and NaN stays NaN."""

import numpy as np
import pytest

from tests.analysis.exports.databases import database, points
from tests.analysis.exports.written import largest_distance, load_module, write

jax = pytest.importorskip("jax")


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    folder = write(tmp_path_factory.mktemp("jax"), "jax")
    with pytest.MonkeyPatch.context() as patch:
        return load_module(folder, "traction_jax", patch)


@pytest.fixture(scope="module")
def terrains(module):
    return module.load()


def single(*columns):
    return [column.astype(np.float32) for column in columns]


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_forces_are_within_1e_5_of_the_largest(module, terrains, name):
    F_n, v_t = points()
    usual = (np.abs(F_n) < 1e30) & (v_t < 1e30)
    F_n, v_t = single(F_n[usual], v_t[usual])
    forces = np.asarray(jax.jit(module.quantiles)(terrains[name], F_n, v_t))
    known = database().terrain(name)
    expected = known.predict(F_n.astype(np.float64), v_t.astype(np.float64)).forces
    assert np.abs(forces.T - expected).max() <= 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_risks_equal_python_and_rise_with_the_force(module, terrains, name):
    known = database().terrain(name)
    rng = np.random.default_rng(2)
    F_t, F_n, v_t = single(
        rng.uniform(-1, 15, 500), rng.uniform(0, 12, 500), rng.uniform(0.005, 0.2, 500)
    )
    sliding, rest = jax.jit(module.risk_sliding), jax.jit(module.risk_rest)
    risks = sliding(terrains[name], F_t, F_n, v_t)
    rows = zip(F_t, F_n, v_t, strict=True)
    expected = [known.risk_in_motion(*map(float, row)) for row in rows]
    assert np.abs(np.asarray(risks) - expected).max() <= 1e-4
    required = np.abs(F_t)
    risks = rest(terrains[name], required, F_n)
    model = known.from_rest
    expected = model.risks(required.astype(np.float64), F_n.astype(np.float64))
    assert np.abs(np.asarray(risks) - expected).max() <= 1e-4
    rising = np.linspace(0.0, 30.0, 5000, dtype=np.float32)
    for made in (
        sliding(terrains[name], rising, 4.0, 0.03),
        rest(terrains[name], rising, 4.0),
    ):
        assert (np.diff(np.asarray(made)) >= -1e-6).all()
        assert made[-1] - made[0] > 0.8


def test_nan_stays_nan(module, terrains):
    nan, params = float("nan"), terrains["S0"]
    assert np.isnan(module.quantiles(params, nan, 0.05)).all()
    assert np.isnan(module.quantiles(params, 3.0, nan)).all()
    for row in ((nan, 3.0, 0.05), (2.0, nan, 0.05), (2.0, 3.0, nan)):
        assert np.isnan(module.risk_sliding(params, *row))
    assert np.isnan(module.risk_rest(params, nan, 3.0))
    assert np.isnan(module.risk_rest(params, 3.0, nan))
    assert np.isnan(module.risk_rest(params, -1.0, 3.0))


def test_vmap_and_grad_go_through(module, terrains):
    params = terrains["S0"]
    slope = jax.grad(lambda F_n: module.quantiles(params, F_n, 0.05)[4])(3.3)
    known = database().terrain("S0")
    low, high = (known.predict(3.3 + step, 0.05).median for step in (-1e-4, 1e-4))
    assert float(slope) == pytest.approx((high - low) / 2e-4, rel=1e-3)
    loads = np.linspace(1.0, 5.0, 7, dtype=np.float32)
    many = jax.vmap(module.quantiles, (None, 0, None))(params, loads, 0.05)
    assert np.allclose(many, module.quantiles(params, loads, 0.05))


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_mu_is_drawn_with_the_quantiles_of_the_profile(module, terrains, name):
    params = terrains[name]
    drawn = np.asarray(module.sample_mu(params, jax.random.key(3), (10_000,)))
    shares, mu = np.asarray(params.mu_shares), np.asarray(params.mu)
    assert largest_distance(drawn, shares, mu) <= 0.02
    again = module.sample_mu(params, jax.random.key(3), (10_000,))
    assert np.array_equal(drawn, again)
