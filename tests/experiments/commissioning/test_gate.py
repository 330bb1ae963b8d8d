"""Torque is sent only to an arm whose commissioning record is sound and current."""

import json
from datetime import UTC, datetime, timedelta

import pytest

from acquisition.errors import PreflightError
from experiments.commissioning.evidence.daily_record import (
    DailyCheck,
    read_history,
    write_history,
)
from experiments.commissioning.evidence.gate import check_commissioned
from experiments.commissioning.evidence.inputs import current_inputs, inputs_of
from experiments.commissioning.evidence.order import GATED, ORDER, StepId
from experiments.commissioning.evidence.record import NAME, Raw, write_commissioning
from experiments.operator.console import BAD, GOOD, WARNING
from experiments.preflight.connecting import connect_rig
from experiments.rig.requests import LastAnswers, StartArm
from experiments.rig.rig import FakeOptions
from experiments.settings.load import load_settings
from lab.guest.commissioned import sound_record
from tests.experiments.program import changed, write_config

FRICTION = ("compensation = 0.7", "compensation = 0.6")  # of rig.toml


class Arm:
    """An arm in stepped time that is checked like a real one."""

    def __init__(self, config, wrong=""):
        settings = load_settings(config)
        fake = FakeOptions("fast", 1, 0.7, wrong=wrong)
        self.rig = connect_rig(settings, settings.matrix.terrains[0], fake)
        self.info = self.rig.backend.ask(StartArm())
        self.lines = []

    def check(self, made_anew=()):
        self.lines.clear()

        def add(*line):
            self.lines.append(line)

        try:
            return check_commissioned(self.rig, self.info, add, made_anew)
        finally:
            self.rig.backend.close()

    def refusal(self):
        with pytest.raises(PreflightError) as refused:
            self.check()
        assert self.lines[-1][0] == BAD
        return refused.value


@pytest.fixture
def config(tmp_path):
    """A rig.toml with a sound record of its arm."""
    path = write_config(tmp_path)
    arm = Arm(path)
    write_commissioning(tmp_path, sound_record(arm.rig, arm.info))
    arm.rig.backend.close()
    return path


def test_an_arm_without_a_record_is_refused(config):
    (config.parent / NAME).unlink()
    refusal = Arm(config).refusal()
    assert "C0 configuration: not done, and 11 more" in refusal.message
    assert refusal.hint == "traction commission --from C0"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("foot_speed = 0.8 ", "foot_speed = 0.7 ", "C0 configuration: stale: [limits]"),
        ("speed_fault = 1.0", "speed_fault = 0.9", "C0 configuration: stale: [safety]"),
        (*FRICTION, "C10 lift: stale: [friction]"),
    ],
)
def test_a_record_made_stale_by_settings_is_refused(config, old, new, words):
    config.write_text(changed(config.read_text(), old, new))
    assert words in Arm(config).refusal().message


def test_an_arm_with_a_replaced_puck_is_refused(config):
    refusal = Arm(config, "one-puck-replaced").refusal()
    assert "C2 identity: stale: serial number" in refusal.message


def test_an_edited_record_is_refused(config):
    path = config.parent / NAME
    content = json.loads(path.read_text())
    content["steps"][8]["operator"] = "another"
    path.write_text(json.dumps(content))
    assert "was changed at or before C8 rest pose" in Arm(config).refusal().message


def test_a_record_of_a_simulated_arm_does_not_count_for_a_real_one(config):
    arm = Arm(config)
    record = sound_record(arm.rig, arm.info)
    simulated = record.model_copy(update={"is_simulated": True})
    write_commissioning(config.parent, simulated)
    assert "C0 configuration: not done" in arm.refusal().message


def test_a_sound_record_passes_and_recordings_name_the_open_steps(config):
    arm = Arm(config)
    status = arm.check()["commissioning"]
    assert [mark for mark, *_ in arm.lines] == [GOOD, WARNING]
    assert status.startswith("uncommissioned: C12 lock and clock: not done")


def test_a_record_of_every_step_is_complete(config):
    arm = Arm(config)
    record = sound_record(arm.rig, arm.info)
    present = current_inputs(arm.rig, arm.rig.backend.ask(LastAnswers()), arm.info)
    for step in ORDER[len(GATED) :]:
        subject = "S0" if step is StepId.CONTAINER else ""
        inputs = inputs_of(step, present)
        changes = {"step": step, "subject": subject, "inputs": inputs}
        record = record.with_step(record.steps[0].model_copy(update=changes))
    write_commissioning(config.parent, record)
    status = {"commissioning": "complete", "daily_check": "commissioned today"}
    assert arm.check() == status


def test_a_section_that_a_command_measures_anew_is_not_stale_for_it(config):
    config.write_text(changed(config.read_text(), *FRICTION))
    assert Arm(config).check(("[friction]",))


def date_record(config, hours):
    """Date a sound record `hours` back."""
    arm = Arm(config)
    record = sound_record(arm.rig, arm.info)
    for done in record.steps:
        ended = done.ended - timedelta(hours=hours)
        record = record.with_step(done.model_copy(update={"ended": ended}))
    write_commissioning(config.parent, record)
    arm.rig.backend.close()


def checked(config, hours, cause="", *, is_simulated=False):
    """Write a daily check of `hours` ago."""
    arm = Arm(config)
    now = datetime.fromtimestamp(arm.rig.clock.utc_ns() // 10**9, UTC)
    arm.rig.backend.close()
    ended = now - timedelta(hours=hours)
    done = DailyCheck(
        started=ended,
        ended=ended,
        operator="one",
        raw=Raw(file="daily.npz", sha256="0" * 64),
        quantities=(),
        cause=cause,
    )
    history = read_history(config.parent, is_simulated=is_simulated)
    write_history(config.parent, history.with_check(done))


def daily_status(config):
    arm = Arm(config)
    status = arm.check()["daily_check"]
    (line,) = [line for line in arm.lines if line[1] == "daily check"]
    return line[0], status


def test_a_day_without_a_check_is_noted_in_recordings(config):
    date_record(config, 30)
    assert daily_status(config) == (WARNING, "none today")
    checked(config, 17)
    mark, status = daily_status(config)
    assert (mark, status[:27]) == (WARNING, "none today, the last one 20")


def test_a_check_of_today_is_noted_in_recordings(config):
    date_record(config, 30)
    checked(config, 15)
    mark, status = daily_status(config)
    assert (mark, status[-5:]) == (GOOD, "sound")


def test_an_arm_whose_check_failed_is_refused_until_one_passes(config):
    date_record(config, 30)
    checked(config, 20, "lift-off of joint 2 over that of the commissioning 0.2.")
    refusal = Arm(config).refusal()
    assert "The daily check of this arm failed: " in refusal.message
    assert "lift-off of joint 2" in refusal.message
    checked(config, 1)
    assert daily_status(config)[0] == GOOD


@pytest.mark.parametrize("hours", [-0.2, -24, -90000])
def test_a_check_dated_in_the_future_is_refused_until_a_new_one(config, hours):
    """After a wrong clock such a check would be valid for years."""
    date_record(config, 30)
    checked(config, hours)
    refusal = Arm(config).refusal()
    assert "UTC: this computer's clock says 20" in refusal.message
    assert "timedatectl" in refusal.hint
    assert "traction commission --daily" in refusal.hint
    checked(config, 0)
    assert daily_status(config)[0] == GOOD


def test_a_check_stays_valid_if_the_clock_is_set_back_by_minutes(config):
    date_record(config, 30)
    checked(config, -0.05)
    assert daily_status(config)[0] == GOOD


@pytest.mark.parametrize("hours", [-0.2, -23, -24 * 400])
def test_a_commissioning_dated_in_the_future_is_refused(config, hours):
    date_record(config, hours)
    assert "UTC, in the future" in Arm(config).refusal().message


def test_a_failed_check_before_a_new_commissioning_does_not_count(config):
    date_record(config, 2)
    checked(config, 3, "lift-off of joint 2.")
    assert daily_status(config) == (GOOD, "commissioned today")


def test_checks_of_a_simulated_arm_do_not_count_for_a_real_one(config):
    date_record(config, 30)
    checked(config, 1, "lift-off of joint 2.", is_simulated=True)
    assert daily_status(config) == (WARNING, "none today")


def test_an_invalid_history_is_refused(config):
    (config.parent / "daily.json").write_text("[]")
    assert "daily.json cannot be read" in Arm(config).refusal().message
