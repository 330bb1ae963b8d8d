"""A whole simulated first day of `traction commission`, and the daily checks after."""

import pytest

from experiments.commands.commission import FAKE_FOLDER
from experiments.commissioning.evidence.daily_record import read_history
from experiments.commissioning.evidence.gate import lacks
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.evidence.record import (
    read_commissioning,
    write_commissioning,
)
from experiments.commissioning.procedure import STEPS
from tests.experiments.program import traction, write_config

pytestmark = [pytest.mark.long, pytest.mark.timeout(1800)]
OPTIONS = ("--fake", "--fast", "--operator-script", "auto", "--seed", 1)
NAMES = ("--operator", "Ada")


def commission(folder, *more):
    """Continue with the steps that are due."""
    config = folder / "rig.toml"
    return traction("commission", *OPTIONS, "--config", config, *more)


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    """The folder of a sound arm commissioned in one run, and the command's result."""
    folder = tmp_path_factory.mktemp("day")
    write_config(folder, travel=0.45)  # long enough to distinguish its corners
    done = commission(folder, *NAMES)
    assert done.code == 0, (done.out, done.err)
    return folder, done


def test_a_sound_arm_passes_every_step_in_one_run(day):
    folder, done = day
    record = read_commissioning(folder / FAKE_FOLDER)
    assert [(entry.step, entry.cause) for entry in record.steps] == [
        (step, "") for step in STEPS
    ]
    assert {entry.operator for entry in record.steps} == {"Ada"}
    assert lacks(record, {}, record.steps[-1].ended, "S0") == []
    assert "Every step is sound" in done.out


def test_the_recordings_of_a_sound_arm_pass_a_recheck(day):
    folder, _ = day
    before = read_commissioning(folder / FAKE_FOLDER)
    config = folder / "rig.toml"
    done = traction("commission", "--fake", "--recheck", "--config", config)
    assert done.code == 0, (done.out, done.err)
    assert read_commissioning(folder / FAKE_FOLDER) == before


def test_a_sound_arm_passes_the_daily_check(day):
    folder, _ = day
    done = commission(folder, *NAMES, "--daily")
    assert done.code == 0, (done.out, done.err)
    (check,) = read_history(folder / FAKE_FOLDER, is_simulated=True).checks
    assert (check.cause, check.operator) == ("", "Ada")
    assert (check.ended - check.started).total_seconds() < 150
    names = {entry.name for entry in check.quantities}
    assert "lift-off of joint 4 over that of the commissioning" in names


def test_a_torn_cable_fails_the_daily_check_before_the_arm_is_activated(day):
    folder, _ = day
    done = commission(folder, *NAMES, "--daily", "--wrong", "cable-4-torn")
    assert done.code == 3, (done.out, done.err)
    assert "Shift-activate" not in done.out
    check = read_history(folder / FAKE_FOLDER, is_simulated=True).checks[-1]
    assert check.cause.startswith("weight of the foot")


def test_a_weak_motor_fails_the_daily_check(day):
    folder, _ = day
    done = commission(folder, *NAMES, "--daily", "--wrong", "motor-2-weak")
    assert done.code == 3, (done.out, done.err)
    check = read_history(folder / FAKE_FOLDER, is_simulated=True).checks[-1]
    assert "joint 2" in check.cause


def test_an_interrupted_commissioning_continues_with_the_next_step(day):
    kept = day[0] / FAKE_FOLDER
    record = read_commissioning(kept)
    middle = StepId.HUNG_WEIGHT
    count = list(STEPS).index(middle) + 1
    first = record.steps[:count]
    assert first[-1].step is middle
    left = record.model_copy(update={"steps": first})
    write_commissioning(kept, left)
    done = commission(day[0], *NAMES, "--until", "C9")
    assert done.code == 0, (done.out, done.err)
    again = read_commissioning(kept)
    assert again.steps[: len(first)] == first
    continued = [done.step for done in again.steps[len(first) :]]
    assert continued == [StepId.REST_POSE, StepId.RAMPS]
    assert "Still to do: C10, C11, C12, C13, C14." in done.out
