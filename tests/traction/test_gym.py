"""Stances as a Gymnasium environment: its rules, its rewards, and who slips."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.stance.interface import StanceRequest
from tests.fakes.stance_bench import TRAVEL, StanceBench, record

gymnasium = pytest.importorskip("gymnasium")

import traction.gym as stance_gym  # noqa: E402 - it needs gymnasium

ROOT = Path(__file__).parents[2]


def played(env, policy, seed=None):
    """Return observations, rewards and info of one episode."""
    observation, info = env.reset(seed=seed)
    seen, rewards, is_over = [observation], [], False
    while not is_over:
        observation, reward, is_over, is_cut, info = env.step(policy(observation))
        assert not is_cut
        seen.append(observation)
        rewards.append(reward)
    return np.array(seen), rewards, info


def steady(F_t, F_n):
    return lambda _: stance_gym.action_of(F_t, F_n)


def test_check_env_passes():
    from gymnasium.utils.env_checker import check_env

    check_env(gymnasium.make("Traction/Stance-v0", terrain="TF").unwrapped)


@pytest.mark.parametrize(
    ("mode", "options"),
    [
        ("sync", {}),
        # not forked: other tests may have left threads
        pytest.param("async", {"context": "spawn"}, marks=pytest.mark.slow),
    ],
)
def test_it_is_vectorised(mode, options):
    envs = gymnasium.make_vec(
        "Traction/Stance-v0",
        num_envs=2,
        vectorization_mode=mode,
        vector_kwargs=options,
        terrain="TF",
    )
    seen, _ = envs.reset(seed=5)
    assert seen.shape == (2, len(stance_gym.OBSERVED))
    for _ in range(5):
        seen, rewards, *_ = envs.step(envs.action_space.sample())
    assert rewards.shape == (2,)
    envs.close()


def test_the_same_seed_is_the_same_stance():
    env = stance_gym.StanceEnv("S0")
    first, second, other = (played(env, steady(5.0, 10.0), seed) for seed in (3, 3, 4))
    assert np.array_equal(first[0], second[0])
    assert first[1] == second[1]
    assert not np.array_equal(first[0], other[0])


def test_a_gentle_push_on_a_plate_delivers_all_and_slips_nowhere():
    env = stance_gym.StanceEnv("TF")
    seen, rewards, info = played(env, steady(5.0, 15.0), 1)
    assert info["is_success"]
    assert sum(rewards) == pytest.approx(1.0)
    column = dict(zip(stance_gym.OBSERVED, seen.T, strict=True))
    assert column["is_loaded"][0] == 0.0
    assert column["F_n"][column["is_loaded"] > 0] == pytest.approx(15.0, abs=2.0)
    assert column["impulse"][-1] >= env.request.impulse
    assert column["left"][0] == pytest.approx(env.request.impulse)


def test_a_push_beyond_friction_slips_and_costs_one():
    _, rewards, info = played(stance_gym.StanceEnv("Tf"), steady(11.0, 3.0), 1)
    assert info["outcome"]["is_slip"]
    assert not info["is_success"]
    assert sum(rewards) < 0.0


def test_an_idle_policy_ends_after_three_seconds():
    seen, rewards, info = played(stance_gym.StanceEnv("TF"), steady(0.0, 5.0), 1)
    assert seen[-1][0] == pytest.approx(3.0, abs=0.03)
    assert not info["is_success"]
    assert sum(rewards) < 0.1


def test_a_stance_is_judged_as_by_the_sequence():
    """The same pushes on the same ground slip alike: TF holds, Tf does not."""
    from analysis.stance.policies import POLICIES
    from analysis.stance.sequence import StancePlan

    for terrain in ("TF", "Tf"):
        plan = StancePlan(POLICIES["constant-mu"], StanceRequest(6.0), 3, TRAVEL, 0.3)
        usual = record(StanceBench(terrain, 1, 0), plan).outcomes
        made = stance_gym.score(steady(6.0, 12.0), terrain, 3)
        assert made.slips == np.mean([one.is_slip for one in usual])


@pytest.mark.parametrize("action", [[np.nan, 0.0], [0.0], [[0.0, 0.0]], [np.inf, 0.0]])
def test_an_action_that_is_none_is_refused(action):
    env = stance_gym.StanceEnv("TF")
    env.reset(seed=1)
    with pytest.raises(ValueError, match="two finite numbers"):
        env.step(np.array(action))


def test_forces_become_actions_and_stay_within_their_range():
    assert stance_gym.action_of(0.0, 3.0).tolist() == [-1.0, -1.0]
    assert stance_gym.action_of(11.0, 20.0).tolist() == [1.0, 1.0]


def test_unknown_terrains_and_peaks_are_refused():
    with pytest.raises(SettingsError, match="no terrain"):
        gymnasium.make("Traction/Stance-v0", terrain="S99")
    with pytest.raises(SettingsError, match=r"4\.\.10"):
        gymnasium.make("Traction/Stance-v0", peak=50.0)
    with pytest.raises(SettingsError, match="stances"):
        stance_gym.score(steady(1.0, 5.0), "TF", 0)


@pytest.mark.slow
def test_without_gymnasium_the_extra_is_named():
    code = "import sys; sys.modules['gymnasium'] = None; import traction.gym"
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "traction[gym]" in done.stderr
