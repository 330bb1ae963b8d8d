"""The record of a commissioning reveals edits, and steps that are missing or stale."""

import json
from datetime import UTC, datetime, timedelta

import pytest

from acquisition.errors import PreflightError, SettingsError
from experiments.commissioning.evidence.gate import input_names_of, lacks, require
from experiments.commissioning.evidence.order import (
    GATED,
    ORDER,
    REPORTED_INPUTS,
    STEP_INPUTS,
    StepId,
)
from experiments.commissioning.evidence.record import (
    NAME,
    Commissioning,
    Measured,
    StepRecord,
    read_commissioning,
    write_commissioning,
)

NOON = datetime(2026, 11, 26, 12, tzinfo=UTC)
INPUTS = {name: f"{number:064x}" for number, name in enumerate(STEP_INPUTS)}


def done(step, **changed):
    values = {
        "step": step,
        "started": NOON,
        "ended": NOON + timedelta(minutes=5),
        "operator": "one",
        "inputs": {name: INPUTS[name] for name in input_names_of(step)},
        "quantities": (Measured(name="travel", value=1.25, unit="%", high=1.7),),
        "verdict": "sound",
    }
    return StepRecord(**{**values, **changed})


def whole(*steps):
    record = Commissioning(program="0.3.0")
    for step in steps or ORDER:
        record = record.with_step(done(step))
    return record


def test_a_record_is_read_as_written(tmp_path):
    record = whole()
    write_commissioning(tmp_path, record)
    assert read_commissioning(tmp_path) == record


def test_a_folder_without_the_file_has_no_record(tmp_path):
    assert read_commissioning(tmp_path) is None


def test_a_repeated_step_replaces_the_earlier_one():
    again = whole().with_step(done(StepId.TIMING, cause="a slow adapter"))
    assert [entry.step for entry in again.steps] == list(ORDER)
    assert again.of(StepId.TIMING).cause == "a slow adapter"
    assert again.first_broken() is None


@pytest.mark.parametrize("step", ORDER)
def test_a_changed_number_is_noticed_at_its_step(tmp_path, step):
    write_commissioning(tmp_path, whole())
    path = tmp_path / NAME
    content = json.loads(path.read_text())
    content["steps"][ORDER.index(step)]["quantities"][0]["value"] = 1.2
    path.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match=f"was changed at or before {step} "):
        read_commissioning(tmp_path)


def test_a_removed_step_is_noticed_at_the_next(tmp_path):
    write_commissioning(tmp_path, whole())
    path = tmp_path / NAME
    content = json.loads(path.read_text())
    del content["steps"][3]
    path.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match="was changed at or before C4 "):
        read_commissioning(tmp_path)


HOSTILE = {
    "empty file": "",
    "not an object": "[]",
    "another version": '{"version": 1, "program": "x"}',
    "an unknown key": '{"program": "x", "steps": [], "torque": 1}',
    "a text for a number": '{"program": 1}',
    "unterminated": '{"program": "x", "steps": [' + "[" * 5000,
    "a million wrong steps": '{"program": "x", "steps": [' + "1," * 999_999 + "1]}",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_an_invalid_file_is_refused_with_a_short_message(tmp_path, text):
    (tmp_path / NAME).write_text(text)
    with pytest.raises(SettingsError, match="cannot be read") as refused:
        read_commissioning(tmp_path)
    assert len(str(refused.value)) < 600


def test_a_link_is_not_followed(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    write_commissioning(elsewhere, whole())
    (tmp_path / NAME).symlink_to(elsewhere / NAME)
    with pytest.raises(SettingsError, match="cannot be read"):
        read_commissioning(tmp_path)


@pytest.mark.parametrize(
    "order", [(StepId.TIMING, StepId.LISTEN), (StepId.LISTEN,) * 2]
)
def test_steps_out_of_order_or_repeated_are_refused(order):
    steps = tuple(done(step) for step in order)
    with pytest.raises(ValueError, match="not in order"):
        Commissioning(program="x", steps=steps)


# --- the gate -----------------------------------------------------------------------


def test_a_complete_record_lacks_no_step():
    assert lacks(whole(), INPUTS, NOON) == []
    require([])


def test_without_a_record_every_step_is_missing_and_the_first_is_reported():
    lacking = lacks(None, INPUTS, NOON)
    assert [lack.step for lack in lacking] == list(ORDER)
    with pytest.raises(PreflightError, match="C0 configuration: not done, and 11 more"):
        require(lacking)


@pytest.mark.parametrize("name", STEP_INPUTS)
def test_a_changed_input_makes_its_steps_stale_and_no_others(name):
    lacking = lacks(whole(), {**INPUTS, name: "f" * 64}, NOON)
    assert tuple(lack.step for lack in lacking) == STEP_INPUTS[name].steps
    assert all(
        f"stale: {STEP_INPUTS[name].words} changed" in lack.text for lack in lacking
    )


def test_an_unknown_input_makes_no_step_stale():
    present = {name: digest for name, digest in INPUTS.items() if name != "module"}
    assert lacks(whole(), present, NOON) == []


@pytest.mark.parametrize("name", REPORTED_INPUTS)
def test_a_reported_change_makes_its_steps_stale_until_they_are_repeated(name):
    record = whole().with_reported_change(name, NOON + timedelta(hours=1))
    lacking = lacks(record, INPUTS, NOON + timedelta(hours=2))
    assert tuple(lack.step for lack in lacking) == STEP_INPUTS[name].steps
    assert "changed on 2026-11-26, as told" in lacking[0].text
    present = {**INPUTS, **record.reported_inputs()}
    for step in STEP_INPUTS[name].steps:
        inputs = {key: present[key] for key in input_names_of(step)}
        record = record.with_step(done(step, inputs=inputs))
    assert lacks(record, INPUTS, NOON) == []


def test_a_removed_report_of_a_change_is_noticed(tmp_path):
    record = whole().with_reported_change("cables", NOON + timedelta(hours=1))
    write_commissioning(tmp_path, record)
    assert read_commissioning(tmp_path) == record
    path = tmp_path / NAME
    content = json.loads(path.read_text())
    content["told"] = {}
    path.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match="was changed at or before C0 "):
        read_commissioning(tmp_path)


def test_all_steps_are_stale_after_a_limited_time():
    late = NOON + timedelta(days=30, minutes=6)
    lacking = lacks(whole(), INPUTS, late)
    assert [lack.step for lack in lacking] == list(ORDER)
    assert lacks(whole(), INPUTS, late - timedelta(minutes=2)) == []


def test_a_record_dated_in_the_future_does_not_count():
    lacking = lacks(whole(), INPUTS, NOON - timedelta(days=400))
    assert [lack.step for lack in lacking] == list(ORDER)


def test_a_step_that_failed_is_reported_with_its_cause():
    record = whole().with_step(
        done(StepId.RAMPS, verdict="wrong", cause="joint 3 moves the other way")
    )
    with pytest.raises(PreflightError, match="C9 ramps: joint 3 moves the other way"):
        require(lacks(record, INPUTS, NOON))


def test_steps_beyond_the_gate_do_not_prevent_driving():
    record = whole(*GATED)
    lacking = lacks(record, INPUTS, NOON)
    assert [str(lack.step) for lack in lacking] == ["C12", "C13", "C14"]
    require(lacking)


@pytest.mark.parametrize(
    ("value", "low", "high", "passes", "text"),
    [
        (1.25, None, 1.7, True, "travel 1.25 % (at most 1.7)"),
        (1.8, None, 1.7, False, "travel 1.8 % (at most 1.7)"),
        (0.5, 1.0, 2.0, False, "travel 0.5 % (at least 1 and at most 2)"),
        (0.5, None, None, True, "travel 0.5 %"),
    ],
)
def test_a_quantity_is_printed_with_its_limits(value, low, high, passes, text):
    quantity = Measured(name="travel", value=value, unit="%", low=low, high=high)
    assert (quantity.is_within, quantity.text) == (passes, text)


# --- one container per terrain -------------------------------------------------------


def test_every_terrain_keeps_its_own_container():
    first = done(StepId.CONTAINER, subject="S0")
    other = {**INPUTS, "terrain": "e" * 64}
    second = done(
        StepId.CONTAINER,
        subject="S10",
        inputs={name: other[name] for name in input_names_of(StepId.CONTAINER)},
    )
    record = whole(*ORDER[:-2]).with_step(second).with_step(first)
    record = record.with_step(done(StepId.PLATE))
    assert [entry.subject for entry in record.steps if entry.subject] == ["S0", "S10"]
    assert lacks(record, INPUTS, NOON, "S0") == []
    assert lacks(record, other, NOON, "S10") == []
    (stale,) = lacks(record, other, NOON, "S0")
    assert stale.text.startswith("C13 container of S0: stale: row of the terrain")
    (missing,) = lacks(record, INPUTS, NOON, "TF")
    assert missing.text == "C13 container of TF: not done"
    again = record.with_step(done(StepId.CONTAINER, subject="S0", cause="moved"))
    assert again.of(StepId.CONTAINER, "S0").cause == "moved"
    assert again.of(StepId.CONTAINER, "S10") is not None
