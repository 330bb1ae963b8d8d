"""A ground that can be sampled: stable, the same by seed, kept in the database."""

import json
from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.terrains.database import load, to_text
from analysis.terrains.generator import GATES, Draws, Generator, Motion
from analysis.terrains.generator_fit import (
    fit_experts,
    fit_generator,
    fit_generator_of_size,
    held_drift,
    prepare,
)
from analysis.terrains.parts import GENERATOR_PART
from analysis.terrains.process_rows import ProcessTrial, held_longer
from analysis.terrains.process_scores import (
    energy_score,
    events_of,
    falls,
    ks_distance,
    variogram_score,
)
from tests.analysis.terrains.test_database import saved, skewed


def trial_of(seed, samples=600):
    """Return a ground that loads along the way and gives way at a drawn force."""
    rng = np.random.default_rng(seed)
    F, F_t, v_t = 1.0, np.empty(samples), np.empty(samples)
    capacity = 6.0
    for i in range(samples):
        gives = capacity < F
        if gives:
            F, capacity = 0.5, 6.0 * np.exp(0.3 * rng.normal())
        v_t[i] = 0.15 if gives else 0.02 + 0.002 * rng.normal()
        F += 1.2e3 * 0.01 * 0.02 * (1.0 + 0.1 * rng.normal())
        F_t[i] = F + 0.05 * rng.normal()
    F_n = 4.0 + np.sin(0.01 * np.arange(samples) + seed)
    return ProcessTrial(F_n, v_t, F_t)


@pytest.fixture(scope="module")
def trials():
    return [trial_of(seed) for seed in range(6)]


@pytest.fixture(scope="module")
def known(trials):
    return fit_generator_of_size(prepare(trials, 0), 6, 0)


def test_the_same_seed_gives_the_same_forces_bit_for_bit(known):
    new = trial_of(20)
    first, again = (known.sample(new.F_n, new.v_t, 7, 3).forces for _ in "ab")
    assert first.tobytes() == again.tobytes()
    assert first.shape == (3, 600)
    assert (
        first[2].tobytes() == known.sample(new.F_n, new.v_t, 7, 9).forces[2].tobytes()
    )
    assert np.abs(first - known.sample(new.F_n, new.v_t, 8, 3).forces).max() > 0.5


def test_a_sample_has_the_events_of_the_ground(known):
    tested = [trial_of(seed) for seed in range(30, 36)]
    paths = [known.sample(t.F_n, t.v_t, k, 4).forces for k, t in enumerate(tested)]
    made, true = (events_of(f, tested, 1.5) for f in (paths, [t.F_t for t in tested]))
    assert made.drops_per_metre == pytest.approx(true.drops_per_metre, rel=0.25)
    assert ks_distance(made.drops, true.drops) < 0.35
    white = [
        np.random.default_rng(0).permuted(np.tile(t.F_t, (4, 1)), axis=1)
        for t in tested
    ]
    scores = [
        np.mean([variogram_score(p, t.F_t) for p, t in zip(x, tested, strict=True)])
        for x in (paths, white)
    ]
    assert scores[0] < 0.5 * scores[1]


@pytest.mark.slow
def test_free_runs_stay_where_trials_were_in_sticks_of_20_s(known, trials):
    assert held_drift(known, trials, 3) < 3.0
    held = held_longer(trials[0], 20.0)
    assert held.end - held.start == 2000
    forces = known.sample(held.trial.F_n, held.trial.v_t, 0, 20).forces
    recorded = np.concatenate([t.F_t for t in trials])
    level = 4.0 * known.between
    assert forces.min() > recorded.min() - 1.0 - level
    assert forces.max() < recorded.max() + 3.0 + level


def test_few_trials_make_no_generator(trials):
    assert fit_generator(trials[:3], 0, 1.5) is None


@pytest.mark.slow
@pytest.mark.timeout(180)  # it is fitted as often as it is turned down
def test_a_generator_that_runs_away_is_turned_down(known, trials, monkeypatch):
    import analysis.terrains.generator_fit as fit

    wild = replace(known, drift=known.drift + 2.0)
    assert held_drift(wild, trials, 0) > held_drift(known, trials, 0)
    monkeypatch.setattr(fit, "_DRIFTED", -1.0)
    assert fit_generator(trials, 0, 1.5) is None


def test_one_step_is_the_one_that_is_documented(known):
    """The equations at the head of the module, written out for one path."""
    rng = np.random.default_rng(0)
    f, v = 4.0 + rng.normal(size=40), rng.uniform(-0.01, 0.2, 40)
    draws = Draws.of(5, 1, 40, 6)
    (found,) = known.along([Motion.of(f, v, known.bands)], draws)
    low, m, high = known.bands.over(f, v)
    e, F, D = known.experts, m[0], 0.0
    w, h = v[0], abs(v[0])
    for i in range(1, 40):
        w = w + 0.2 * (v[i] - w)
        h = h + 0.02 * (abs(w) - h)
        forward, share = max(v[i], 0.0), min(abs(v[i]) / 0.02, 1.0)
        x = [1.0, F, D, F * forward, F * w, f[i], f[i] - f[i - 1], forward]
        x += [min(v[i], 0.0), v[i] - v[i - 1], v[i - 1], w, m[i], m[i] - m[i - 1]]
        g = np.array([*x, F / max(f[i], 0.8), F * share, share])
        g = np.clip((g - e.centre) / e.scale, -4.0, 4.0)
        g[0] = 1.0
        logits = e.gate @ g
        p = np.exp(logits - logits.max())
        k = int(
            np.searchsorted(np.cumsum(p) / p.sum(), draws.uniform[0, i - 1], "right")
        )
        knots = (-0.03, -0.004, 0.0, 0.004, 0.012, 0.03, 0.07, 0.13, 0.22)
        step = e.weights[k] @ x + np.interp(v[i], knots, known.drift)
        step += e.sd[k] * draws.normal[0, i - 1]
        new = F + min(max((h - 0.002) / 0.004, 0.0), 1.0) * step
        new -= (0.01 if abs(v[i]) < 0.008 else 0.003) * (new - m[i])
        new -= 0.5 * min(new - low[i], 0.0)
        new -= 0.1 * max(new - high[i], 0.0)
        new = min(max(new, known.least), known.most)
        F, D = new, new - F
        assert found[0, i] == pytest.approx(F, abs=1e-9)


# --- in a database --------------------------------------------------------------------


def with_generator(known):
    database = skewed()
    terrain = replace(database.terrain("S0"), parts={GENERATOR_PART: known.to_dict()})
    return replace(database, terrains={"S0": terrain})


def test_a_database_samples_as_the_generator_does(known, tmp_path):
    new = trial_of(20)
    path = saved(tmp_path, to_text(with_generator(known)))
    answer = load(path).terrain("S0").sample(new.F_n, new.v_t, seed=4, n=2)
    assert (
        answer.forces.tobytes() == known.sample(new.F_n, new.v_t, 4, 2).forces.tobytes()
    )
    assert not answer.is_extrapolated.all()
    assert len(json.dumps(known.to_dict())) < 60_000


def test_a_database_without_a_generator_says_so(tmp_path):
    terrain = load(saved(tmp_path, to_text(skewed()))).terrain("S0")
    assert not terrain.has_generator
    with pytest.raises(SettingsError, match="cannot be sampled"):
        terrain.sample([4.0, 4.0], [0.1, 0.1], 0)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("sd", [0.1]),
        ("sd", [-1.0] * 6),
        ("gate", [[0.0] * GATES] * 40),
        ("weights", [["x"] * 14] * 6),
        ("drift", [0.0]),
        ("drift", [float("nan")] * 9),
        ("range", [3.0, 1.0]),
        ("step_ms", 20),
        ("trials", True),
        ("bands", {}),
        ("more", 1),
    ],
)
def test_a_hostile_generator_is_refused(known, tmp_path, key, value):
    content = json.loads(to_text(with_generator(known)))
    content["terrains"]["S0"]["parts"]["generator"][key] = value
    with pytest.raises(SettingsError, match="generator"):
        load(saved(tmp_path, content))


@pytest.mark.parametrize(
    ("F_n", "v_t", "seed", "n"),
    [
        ([4.0], [0.1], 0, 1),
        ([4.0, 4.0], [0.1, np.nan], 0, 1),
        ([4.0, 4.0], [0.1, 0.1, 0.1], 0, 1),
        ([4.0, 4.0], [0.1, 0.1], -1, 1),
        ([4.0, 4.0], [0.1, 0.1], None, 1),
        ([4.0, 4.0], [0.1, 0.1], "1", 1),
        ([4.0, 4.0], [0.1, 0.1], 1.5, 1),
        ([4.0, 4.0], [0.1, 0.1], True, 1),
        ([4.0, 4.0], [0.1, 0.1], 0, 2.0),
        ([4.0, 4.0], [0.1, 0.1], 0, 0),
        ([4.0, 4.0], [0.1, 0.1], 0, 10**9),
    ],
)
def test_what_is_no_motion_is_refused(known, F_n, v_t, seed, n):
    terrain = with_generator(known).terrain("S0")
    with pytest.raises(SettingsError):
        terrain.sample(F_n, v_t, seed, n)


# --- scores ---------------------------------------------------------------------------


def test_falls_are_between_alternating_extremes():
    F = np.array([0.0, 3.0, 2.5, 4.0, 1.0, 1.5, 0.5, 3.0, 2.0, 2.2])
    peaks, floors = falls(F, 1.4)
    assert F[peaks].tolist() == [4.0]
    assert F[floors].tolist() == [0.5]
    peaks, floors = falls(F, 0.9)
    assert F[peaks].tolist() == [4.0, 3.0]


def test_the_energy_score_of_the_truth_itself_is_less_than_that_of_a_shifted_one():
    rng = np.random.default_rng(0)
    paths = np.cumsum(rng.normal(size=(12, 300)), axis=1)
    scores = [energy_score(paths + shift, paths[0] * 0.0) for shift in (0.0, 20.0)]
    assert scores[0] < scores[1]
    assert energy_score(np.zeros((3, 100)), np.ones(100)) == pytest.approx(1.0)


def test_one_expert_is_least_squares():
    rng = np.random.default_rng(0)
    x = np.column_stack([np.ones(500), rng.normal(size=(500, 13))])
    b = rng.normal(size=14)
    d = x @ b + 0.1 * rng.normal(size=500)
    experts = fit_experts(x, np.column_stack([x, rng.normal(size=(500, 3))]), d, 1, 0)
    assert experts.weights[0] == pytest.approx(b, abs=0.05)
    assert experts.sd[0] == pytest.approx(0.1, rel=0.1)


@pytest.mark.slow
def test_a_single_expert_is_stored_and_read_again(trials):
    linear = fit_generator_of_size(prepare(trials, 0), 1, 0)
    again = Generator.from_dict(json.loads(json.dumps(linear.to_dict())))
    assert again.size == 1
    assert again.to_dict() == linear.to_dict()
