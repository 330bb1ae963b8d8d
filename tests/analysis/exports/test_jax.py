"""Functions of JAX: the same answers, pure, and NaN stays NaN."""

import numpy as np
import pytest

from analysis.exports.folder import target_files
from analysis.exports.source import TerrainExport
from analysis.terrains.contact_law import BEFORE, Draw
from analysis.terrains.generator import Draws
from tests.analysis.exports.databases import DIGEST, database, points
from tests.analysis.exports.stepped import (
    LAW,
    generators,
    pushes,
    stepped_database,
)
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


# --- the ground, stepped --------------------------------------------------------------


@pytest.fixture(scope="module")
def stepped(module, tmp_path_factory):
    folder = tmp_path_factory.mktemp("stepped")
    made = TerrainExport.of(stepped_database(), DIGEST, "1.2.3")
    (folder / "terrains.json").write_bytes(target_files("jax", made)["terrains.json"])
    return folder / "terrains.json"


def test_steps_of_the_contact_law_are_those_of_python(module, stepped):
    rows = pushes()[:2000]
    with jax.enable_x64(True):
        params = module.load(stepped)["S0"]

        def step(jam, row):
            force, jam = module.contact_step(params, jam, *row[:4], row[4:])
            return jam, force

        _, found = jax.lax.scan(step, module.jam_before(), rows)
        found = np.asarray(found)
    state, expected = BEFORE, []
    for row in rows.tolist():
        F_t, state = LAW.step(state, *row[:4], Draw(*row[4:]))
        expected.append(F_t)
    assert np.abs(found - expected).max() <= 1e-9


@pytest.mark.parametrize(("name", "which"), [("S0", 0), ("TF", 1)])
def test_a_path_of_the_generator_is_that_of_python(module, stepped, name, which):
    from tests.analysis.terrains.test_generator import trial_of

    generator, motion = generators()[which], trial_of(20)
    draws = Draws.of(5, 1, motion.F_n.size, generator.trials)
    (expected,) = generator.run([(motion.F_n, motion.v_t)], draws)
    with jax.enable_x64(True):
        params = module.load(stepped)[name].sample
        u, z = (each[0, :-1] for each in (draws.uniform, draws.normal))
        found = module.sample_path(params, motion.F_n, motion.v_t, u, z)
        found = np.asarray(found) + generator.between * draws.level[0]
    assert np.abs(found - expected[0]).max() <= 1e-9


def test_a_sample_is_that_of_its_key_and_has_the_level_of_a_trial(module, stepped):
    params = module.load(stepped)["S0"]
    F_n, v_t = single(np.full(20, 4.0), np.full(20, 0.02))
    keys = jax.random.split(jax.random.key(1), 400)
    paths = jax.vmap(module.sample, (None, None, None, 0))(params, F_n, v_t, keys)
    again = module.sample(params, F_n, v_t, keys[7])
    assert np.allclose(paths[7], again, atol=1e-4)
    assert np.isfinite(np.asarray(paths)).all()
    assert np.std(np.asarray(paths)[:, 0]) > generators()[0].between


def test_a_terrain_without_law_and_generator_answers_nan(module, terrains):
    params, jam = terrains["TF"], module.jam_before()
    row = module.draw(jax.random.key(0))
    force, _ = module.contact_step(params, jam, 0.001, 0.0, 0.1, 4.0, row)
    assert np.isnan(force)
    assert np.isnan(
        module.sample(params, np.ones(5), np.ones(5), jax.random.key(0))
    ).all()
