"""The daily check passes an unchanged arm and names what has changed."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from acquisition.errors import SettingsError
from experiments.commissioning import daily
from experiments.commissioning.evidence.daily_record import (
    DailyCheck,
    DailyHistory,
    read_history,
    write_history,
)
from experiments.commissioning.evidence.record import Measured, Raw
from experiments.commissioning.fits import fit_foot
from experiments.commissioning.guide import RecordFolder
from experiments.commissioning.recording import texts
from experiments.commissioning.weights import POSES
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from tests.experiments.commissioning.held_arm import HeldArm
from wam.model.constants import load_constants

SOUND = 40
NOON = datetime(2026, 11, 26, 12, tzinfo=UTC)
HOME = load_constants().home
BEFORE = (18.0, 7.0)  # N m, of joints 2 and 4


@pytest.fixture(scope="module")
def tool():
    return build_tool(load_settings(None).rig, "tread")


def lain(seconds=1.0):
    """Recording of an arm that lies still."""
    t_ns = np.arange(round(seconds / 0.002)) * 2_000_000
    return {"t_ns": t_ns, "q": np.tile(HOME, (len(t_ns), 1)), "ended": texts([])}


def lifted(torques):
    """Recording while joints 2 and 4 are lifted off at `torques` [N m]."""
    parts = []
    for joint, sense, torque in ((2, 1.0, torques[0]), (4, -1.0, torques[1])):
        part = lain()
        tau = np.zeros((len(part["t_ns"]), 7))
        tau[:, joint - 1] = sense * np.linspace(0.0, torque, len(tau))
        q = part["q"].copy()
        q[-5:, joint - 1] += 0.01 * sense
        parts.append((q, tau))
    return {
        "proof": np.repeat([0, 1], len(parts[0][0])),
        "joints": np.array([2, 4]),
        "torques": np.array([30.0, -12.0]),
        "q": np.concatenate([q for q, _ in parts]),
        "tau": np.concatenate([tau for _, tau in parts]),
        "weights": np.array([0.0, 18.7, 0.0, 5.65, 0.0, 0.72, 0.0]),
        "ended": texts([]),
    }


def day(tool, seed, wrong="", torques=BEFORE, **changed):
    """Recording of another day of the arm of `seed`."""
    weight = fit_foot(HeldArm(tool, seed).own_weight()).weight
    poses = [POSES[at] for at in daily.HANGING] * 2  # repeated where a pose did not fit
    held = HeldArm(tool, seed, wrong, another_day=1).own_weight(poses)
    values = {
        "heard_master": np.array(-1),
        "heard_frames": np.array(0),
        "heard_error_frames": np.array(0),
        "replies_ns": np.full(100, 700_000),
        "unasked": np.array(5),
        "late": np.array(0),
        "answer_ns": np.array(290_000),
        "changed": texts([]),
        "zero": np.zeros(0),
        **held,
        "reference_weight": weight,
        "reference_lifted": np.array(BEFORE),
        **{f"rest_{name}": array for name, array in lain().items()},
        **{f"ramp_{name}": array for name, array in lifted(torques).items()},
    }
    return values | changed


@pytest.mark.long
def test_many_sound_arms_pass_on_another_day(tool):
    causes = [daily.judge(day(tool, seed)).cause for seed in range(SOUND)]
    assert causes == [""] * SOUND


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("foot-heavier", "weight of the foot compared"),
        ("sensor-turned-20deg", "weight of the foot"),
        ("sensor-cable-pulls", "weight of the foot"),
        ("zero-2-off-10deg", "weight of the foot"),
    ],
)
@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))]
)
def test_a_change_of_the_arm_is_reported(tool, seed, wrong, words):
    assert daily.judge(day(tool, seed, wrong)).cause.startswith(words)


@pytest.mark.parametrize(
    ("torques", "joint"), [((15.2, 7.0), 2), ((22.0, 7.0), 2), ((18.0, 5.5), 4)]
)
def test_a_changed_lift_off_torque_is_reported(tool, torques, joint):
    cause = daily.judge(day(tool, 1, torques=torques)).cause
    assert cause.startswith(f"lift-off of joint {joint} over that of the commissioning")


def test_a_joint_that_is_lifted_by_less_than_its_weight_is_reported(tool):
    cause = daily.judge(day(tool, 1, torques=(2.8, 7.0))).cause
    assert cause.startswith("lift-off of joint 2 over its weight")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"heard_master": np.array(20)}, "other masters"),
        ({"changed": texts(["a puck"])}, "Changed since the commissioning: a puck"),
        ({"late": np.array(4)}, "with a reply"),
        ({"replies_ns": np.full(100, 1_600_000)}, "seven positions"),
        ({"replies_ns": np.zeros(0)}, "seven positions"),
        ({"answer_ns": np.array(2_300_000)}, "response time"),
        ({"zero": np.radians([0.0, 1.8, 0, 0, 0, 0, 0])}, "zeroed elsewhere"),
    ],
)
def test_a_fault_of_the_bus_or_a_changed_zero_is_reported(tool, changed, words):
    assert words in daily.judge(day(tool, 1, **changed)).cause


def test_an_arm_that_moves_without_torque_is_reported_and_not_lifted(tool):
    values = {k: v for k, v in day(tool, 1).items() if not k.startswith("ramp_")}
    values["rest_q"] = values["rest_q"].copy()
    values["rest_q"][-1, 1] += 0.016
    assert daily.judge(values).cause.startswith("travel of joint 2 without torque")


def test_a_daily_check_before_the_commissioning_is_refused(tmp_path):
    files = RecordFolder.open(tmp_path, is_simulated=True)
    with pytest.raises(SettingsError, match="C6 own weight was not passed"):
        daily.reference_of(files)


# --- its history ----------------------------------------------------------------------


def check(days, lifted_at=1.0, cause=""):
    ended = NOON + timedelta(days=days)
    name = "lift-off of joint 2 over that of the commissioning"
    return DailyCheck(
        started=ended - timedelta(minutes=2),
        ended=ended,
        operator="Ada <A>",
        raw=Raw(file="daily.npz", sha256="0" * 64),
        quantities=(
            Measured(name=name, value=lifted_at, unit="", low=0.85, high=1.15),
            Measured(name="other masters", value=0.0, unit="", high=0.0),
        ),
        cause=cause,
    )


def test_a_history_is_read_as_written_and_valid_for_a_limited_time(tmp_path):
    history = DailyHistory().with_check(check(0)).with_check(check(1))
    write_history(tmp_path, history)
    assert read_history(tmp_path, is_simulated=False) == history
    assert not read_history(tmp_path, is_simulated=True).checks
    assert history.counts_at(NOON + timedelta(days=1, hours=16))
    assert not history.counts_at(NOON + timedelta(days=1, hours=17))
    assert history.counts_at(NOON + timedelta(days=1, minutes=-4))
    assert not history.counts_at(NOON + timedelta(days=1, minutes=-6))
    assert not DailyHistory().counts_at(NOON)
