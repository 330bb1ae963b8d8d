"""Motors whose encoder freezes while a person leads the foot along the container."""

import pytest

from acquisition.control_loop.states import ArmState
from tests.experiments.program import kept_and_sound, write_config
from tests.faults.rehearse import run_whole
from tests.faults.strikes import strike_of
from tests.faults.truth import Promise, is_within

pytestmark = [pytest.mark.slow, pytest.mark.timeout(240)]
IN_MOTION = 2.0  # s after the start of the recording
LEADING = range(2, 7)  # motors that turn whenever a foot is led
STANDING = (1, 7)


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    return write_config(tmp_path_factory.mktemp("config"))


@pytest.mark.parametrize(
    ("motor", "friction"),
    [
        (2, 0.02),
        (5, 0.02),
        (2, 1.0),
        *(
            pytest.param(motor, friction, marks=pytest.mark.long)
            for friction in (0.02, 1.0)
            for motor in LEADING
            if (motor, friction) not in {(2, 0.02), (5, 0.02), (2, 1.0)}
        ),
    ],
)
def test_a_frozen_motor_ends_a_trial_at_low_speed(config, tmp_path, motor, friction):
    strike = strike_of(f"stuck-motor-{motor}")
    seen = run_whole(strike, IN_MOTION, config, tmp_path / "data", friction)
    assert seen.done.code == 4
    assert f"motor {motor} stood still" in seen.done.err
    assert seen.rejected == ["interrupted: motor-still"]
    motion = seen.truth.since(seen.scene.struck_ns, "")
    assert is_within(motion, Promise()), motion
    assert seen.scene.reached_ms("idle", ArmState.IDLE) < 3000.0


@pytest.mark.parametrize(
    "friction", [0.02, pytest.param(0.3, marks=pytest.mark.long), 1.0]
)
def test_a_sound_arm_completes_a_trial_with_any_friction(config, tmp_path, friction):
    seen = run_whole(lambda _: None, IN_MOTION, config, tmp_path / "data", friction)
    assert (seen.done.code, seen.done.err) == (0, "")
    assert kept_and_sound(seen.folder) == ["T01"]


@pytest.mark.parametrize("motor", STANDING)
def test_a_frozen_motor_that_hardly_turns_moves_the_arm_within_bounds(
    config, tmp_path, motor
):
    """The fault is not detected: neither carries weight, and both may rest in a trial.

    The lock does not detect that joint 7 turns, so the ground turns the foot.
    """
    strike = strike_of(f"stuck-motor-{motor}")
    seen = run_whole(strike, IN_MOTION, config, tmp_path / "data", 0.02)
    promise = Promise(speed=3.0 if motor == 7 else 1.0)
    assert is_within(seen.truth.since(seen.scene.struck_ns, ""), promise)
