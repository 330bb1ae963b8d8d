"""Friction for simulators: the trial's level, drawn as measured, obeyed by MuJoCo."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.exports.profile import FrictionProfile, profile_of
from analysis.study.skew import unwarped, warped
from tests.analysis.exports.databases import BEND, LEVEL_SD, database, export
from tests.analysis.exports.written import largest_distance, load_module, write

SIMULATORS = ("mjx", "mjlab", "isaaclab")


def profile(name, spread="episode", **about):
    known = database(**about).terrain(name)
    return profile_of(known, "gp_se_trial", spread, is_simulated=True)


def drawn_by(folder, target, monkeypatch):
    """Return 10^4 coefficients of S0 as the randomiser of a simulator draws them."""
    module = load_module(folder, f"traction_{target}", monkeypatch)
    own = module.load_profile("S0")
    return own.draw(np.random.default_rng(4).random(10_000))


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_the_level_of_trials_that_were_made_comes_back(name):
    """Draw trials by the model's own law and look at the level of each."""
    known = database().terrain(name)
    made = profile(name)
    rng = np.random.default_rng(7)
    axes = np.linspace(*made.F_n, 33), np.linspace(*made.v_t, 33)
    F_n, v_t = (grid.ravel() for grid in np.meshgrid(*axes, indexing="ij"))
    median = known.predict(F_n, v_t).median
    levels = LEVEL_SD[name] * rng.standard_t(9, 4000)
    c = BEND[name]
    mu = [np.median(unwarped(warped(median, c) + u, c) / F_n) for u in levels]
    assert largest_distance(np.array(mu), made.shares, made.mu) <= 0.03


def test_all_of_the_spread_is_wider_than_that_of_episodes():
    episode, every = profile("S0"), profile("S0", "all")
    width = [p.quantile(0.95) - p.quantile(0.05) for p in (episode, every)]
    assert width[1] > 2.0 * width[0]
    assert every.clipped > 0.0
    assert min(every.mu) == 0.0
    assert episode.quantile(0.5) == pytest.approx(every.quantile(0.5), abs=0.1)


def test_a_profile_says_what_is_lost():
    made = export().profiles()
    assert made["simulated"] is True
    about = made["terrains"]["S0"]
    names = set(FrictionProfile.__slots__) | {"identifier", "static_over_sliding"}
    assert set(about) == names
    assert about["F_n"] == (2.0, 10.0)
    assert about["least_median"] < about["mu"][30] < about["most_median"]
    assert about["static"] > about["mu"][30]  # stones: from rest
    assert made["terrains"]["TF"]["static"] is None  # no push slipped


def test_a_model_without_effect_of_a_trial_has_one_number():
    known = database().terrain("S0")
    made = profile_of(known, "gp_se", "episode", is_simulated=True)
    assert made.level_sd is None
    assert len(set(made.mu)) == 1


@pytest.mark.parametrize(
    "parameters",
    [None, [], {"theta": 1}, {"theta": {"log_sc": "x"}, "trials": 3},
     {"theta": {"log_sc": 1e300}, "trials": 3},
     {"theta": {"log_sc": 0.0, "log_sp": 0.1}, "trials": 3},
     {"theta": {"log_sc": float("nan")}, "trials": 3},
     {"theta": {"log_sc": 0.0}, "trials": 1}],
)  # fmt: skip
def test_odd_parameters_are_no_effect_of_a_trial(parameters):
    known = database().terrain("S0")
    odd = replace(known, parameters={"gp_se_trial": parameters})
    made = profile_of(odd, "gp_se_trial", "episode", is_simulated=True)
    assert made.level_sd is None


@pytest.mark.parametrize("spread", ["episode", "all"])
@pytest.mark.parametrize("target", SIMULATORS)
def test_draws_have_the_quantiles_of_the_profile(tmp_path, monkeypatch, target, spread):
    folder = write(tmp_path, target, spread=spread)
    about = json.loads((folder / "profile.json").read_text())["terrains"]["S0"]
    drawn = drawn_by(folder, target, monkeypatch)
    shares, mu = np.array(about["shares"]), np.array(about["mu"])
    if spread == "all":  # the share below 0 is an atom at 0
        assert np.mean(drawn == 0.0) == pytest.approx(about["clipped"], abs=0.02)
        drawn, shares, mu = (x[np.array(m) > 0] for x, m in (
            (drawn, drawn), (shares, mu), (mu, mu)))  # fmt: skip
        shares = (shares - about["clipped"]) / (1.0 - about["clipped"])
    assert largest_distance(drawn, shares, mu) <= 0.02


def test_ranges_of_isaac_lab_are_for_feet_on_ground_that_multiplies(
    tmp_path, monkeypatch
):
    module = load_module(write(tmp_path, "isaaclab"), "traction_isaaclab", monkeypatch)
    made, own = module.feet_friction("S0"), profile("S0")
    low, high = made["dynamic_friction_range"]
    assert (low, high) == pytest.approx((own.quantile(0.05), own.quantile(0.95)))
    ratio = own.static_over_sliding
    assert made["static_friction_range"] == pytest.approx((ratio * low, ratio * high))
    assert made["make_consistent"]
    assert module.GROUND["friction_combine_mode"] == "multiply"
    with pytest.raises(KeyError, match="no terrain 'X'"):
        module.feet_friction("X")


def test_ranges_of_mjlab_say_how_far_they_are_off(tmp_path, monkeypatch):
    module = load_module(write(tmp_path, "mjlab"), "traction_mjlab", monkeypatch)
    assert module.friction_range("S0")[0] < module.friction_range("S0")[1]
    assert 0.04 < module.uniform_distance("TF") < 0.15


def test_a_floor_without_priority_is_refused(tmp_path, monkeypatch):
    pytest.importorskip("jax")
    module = load_module(write(tmp_path, "mjx"), "traction_mjx", monkeypatch)
    model = SimpleNamespace(geom_priority=np.array([0, 0, 0]))
    randomize = module.with_terrain(None, "S0")
    with pytest.raises(ValueError, match="takes the larger friction"):
        randomize(model, np.zeros((4, 2), dtype=np.uint32))
    module.raise_floor(model, 0)
    assert module.has_priority(model, 0)
    assert not module.has_priority(model, 1)


MODEL = """
<mujoco>
  <include file="terrains.xml"/>
  <option timestep="0.001" cone="elliptic" impratio="100"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 0.1" class="traction_S0"/>
    <body pos="0 0 0.05">
      <freejoint/>
      <geom name="foot" type="box" size="0.05 0.05 0.05" mass="0.5" friction="3 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


def pushed(mujoco, model, force, seconds=0.5):
    """Push the foot; return the largest and the last tangential over normal force."""
    data = mujoco.MjData(model)
    ratios = []
    for _ in range(int(seconds / model.opt.timestep)):
        data.xfrc_applied[1, 0] = force
        mujoco.mj_step(model, data)
        total, wrench = np.zeros(3), np.zeros(6)
        for k in range(data.ncon):
            mujoco.mj_contactForce(model, data, k, wrench)
            frame = data.contact[k].frame.reshape(3, 3)
            total += frame.T @ wrench[:3]
        if total[2] > 0.5:
            ratios.append(np.hypot(total[0], total[1]) / total[2])
    return max(ratios), ratios[-1], data.qvel[0]


def test_contact_forces_of_mujoco_obey_the_exported_friction(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    folder = write(tmp_path, "mjx")
    (folder / "model.xml").write_text(MODEL)
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    mu, weight = profile("S0").quantile(0.5), 0.5 * 9.81
    most, last, speed = pushed(mujoco, model, 2.0 * mu * weight)
    assert last == pytest.approx(mu, rel=0.01)  # it slides, although the foot has 3
    assert most <= 1.01 * mu
    assert speed > 0.5
    _, last, speed = pushed(mujoco, model, 0.8 * mu * weight)
    assert last == pytest.approx(0.8 * mu, rel=0.02)
    assert abs(speed) < 0.05


def test_the_randomiser_writes_the_floor_of_every_world(tmp_path, monkeypatch):
    jax = pytest.importorskip("jax")
    mujoco = pytest.importorskip("mujoco")
    mjx = pytest.importorskip("mujoco.mjx")
    folder = write(tmp_path, "mjx")
    (folder / "model.xml").write_text(MODEL)
    module = load_module(folder, "traction_mjx", monkeypatch)
    model = mjx.put_model(mujoco.MjModel.from_xml_path(str(folder / "model.xml")))
    keys = jax.random.split(jax.random.key(1), 10_000)
    made, axes = module.with_terrain(None, "S0")(model, keys)
    friction = np.asarray(made.geom_friction)
    own = profile("S0")
    assert largest_distance(friction[:, 0, 0], own.shares, own.mu) <= 0.02
    assert (friction[:, 1, 0] == 3.0).all()
    assert axes.geom_friction == 0


def test_what_a_wrapped_randomiser_draws_stays(tmp_path, monkeypatch):
    jax = pytest.importorskip("jax")
    mujoco = pytest.importorskip("mujoco")
    mjx = pytest.importorskip("mujoco.mjx")
    folder = write(tmp_path, "mjx")
    (folder / "model.xml").write_text(MODEL)
    module = load_module(folder, "traction_mjx", monkeypatch)
    model = mjx.put_model(mujoco.MjModel.from_xml_path(str(folder / "model.xml")))

    def base(model, rng):
        feet = jax.vmap(lambda key: jax.random.uniform(key, minval=1.0, maxval=2.0))
        worlds = jax.numpy.tile(model.geom_friction, (len(rng), 1, 1))
        friction = worlds.at[:, 1, 0].set(feet(rng)).at[:, 0, 0].set(9.0)
        mass = jax.numpy.tile(model.body_mass, (len(rng), 1)) * feet(rng)[:, None]
        changed = {"geom_friction": friction, "body_mass": mass}
        axes = jax.tree_util.tree_map(lambda _: None, model)
        axes = axes.tree_replace({"geom_friction": 0, "body_mass": 0})
        return model.tree_replace(changed), axes

    keys = jax.random.split(jax.random.key(2), 500)
    plain, _ = base(model, keys)
    made, axes = module.with_terrain(base, "S0")(model, keys)
    assert np.array_equal(made.body_mass, plain.body_mass)
    assert np.array_equal(made.geom_friction[:, 1], plain.geom_friction[:, 1])
    assert not (np.asarray(made.geom_friction[:, 0, 0]) == 9.0).any()
    assert (axes.geom_friction, axes.body_mass) == (0, 0)
    floor, feet = np.asarray(made.geom_friction[:, :2, 0]).T
    assert abs(np.corrcoef(floor, feet)[0, 1]) < 0.15  # a stream of its own
