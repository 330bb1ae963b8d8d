"""The record of a commissioning: what stands in it is what was done."""

import json
from datetime import UTC, datetime, timedelta

import pytest

from acquisition.errors import PreflightError, SettingsError
from experiments.commissioning.evidence.gate import bases_of, lacks, require
from experiments.commissioning.evidence.order import BASES, GATED, ORDER, TOLD, StepId
from experiments.commissioning.evidence.record import (
    NAME,
    Commissioning,
    Measured,
    StepRecord,
    read_commissioning,
    write_commissioning,
)

NOON = datetime(2026, 11, 26, 12, tzinfo=UTC)
INPUTS = {name: f"{number:064x}" for number, name in enumerate(BASES)}


def done(step, **changed):
    values = {
        "step": step,
        "started": NOON,
        "ended": NOON + timedelta(minutes=5),
        "operator": "one",
        "inputs": {name: INPUTS[name] for name in bases_of(step)},
        "quantities": (Measured(name="travel", value=1.25, unit="%", high=1.7),),
        "verdict": "sound",
    }
    return StepRecord(**{**values, **changed})


def whole(*steps):
    record = Commissioning(program="0.3.0")
    for step in steps or ORDER:
        record = record.with_step(done(step))
    return record


def test_what_is_written_is_read(tmp_path):
    record = whole()
    write_commissioning(tmp_path, record)
    assert read_commissioning(tmp_path) == record


def test_a_folder_without_the_file_has_none(tmp_path):
    assert read_commissioning(tmp_path) is None


def test_a_step_that_is_done_again_takes_its_place():
    again = whole().with_step(done(StepId.TIMING, cause="a slow adapter"))
    assert [one.step for one in again.steps] == list(ORDER)
    assert again.of(StepId.TIMING).cause == "a slow adapter"
    assert again.first_broken() is None


@pytest.mark.parametrize("step", ORDER)
def test_a_number_that_was_changed_is_noticed_at_its_step(tmp_path, step):
    write_commissioning(tmp_path, whole())
    path = tmp_path / NAME
    content = json.loads(path.read_text())
    content["steps"][ORDER.index(step)]["quantities"][0]["value"] = 1.2
    path.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match=f"was changed at or before {step} "):
        read_commissioning(tmp_path)


def test_a_step_that_was_taken_out_is_noticed_at_the_next(tmp_path):
    write_commissioning(tmp_path, whole())
    path = tmp_path / NAME
    content = json.loads(path.read_text())
    del content["steps"][3]
    path.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match="was changed at or before C4 "):
        read_commissioning(tmp_path)


HOSTILE = {
    "nothing": "",
    "no object": "[]",
    "another version": '{"version": 1, "program": "x"}',
    "an unknown key": '{"program": "x", "steps": [], "torque": 1}',
    "a text for a number": '{"program": 1}',
    "no end": '{"program": "x", "steps": [' + "[" * 5000,
    "a million wrong steps": '{"program": "x", "steps": [' + "1," * 999_999 + "1]}",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_what_is_no_such_file_is_refused_in_one_sentence(tmp_path, text):
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
def test_steps_stand_in_order_and_once(order):
    steps = tuple(done(step) for step in order)
    with pytest.raises(ValueError, match="not in order"):
        Commissioning(program="x", steps=steps)


# --- the gate -----------------------------------------------------------------------


def test_a_whole_record_lacks_nothing():
    assert lacks(whole(), INPUTS, NOON) == []
    require([])


def test_without_a_record_every_step_is_missing_and_the_first_is_named():
    found = lacks(None, INPUTS, NOON)
    assert [lack.step for lack in found] == list(ORDER)
    with pytest.raises(PreflightError, match="C0 configuration: not done, and 11 more"):
        require(found)


@pytest.mark.parametrize("name", BASES)
def test_what_changed_makes_its_steps_stale_and_no_others(name):
    found = lacks(whole(), {**INPUTS, name: "f" * 64}, NOON)
    assert tuple(lack.step for lack in found) == BASES[name].steps
    assert all(f"stale: {BASES[name].words} changed" in lack.text for lack in found)


def test_what_is_not_known_now_contradicts_nothing():
    known = {name: digest for name, digest in INPUTS.items() if name != "module"}
    assert lacks(whole(), known, NOON) == []


@pytest.mark.parametrize("name", TOLD)
def test_what_a_person_says_makes_its_steps_stale_until_they_are_done_again(name):
    record = whole().with_reported_change(name, NOON + timedelta(hours=1))
    found = lacks(record, INPUTS, NOON + timedelta(hours=2))
    assert tuple(lack.step for lack in found) == BASES[name].steps
    assert "changed on 2026-11-26, as told" in found[0].text
    known = {**INPUTS, **record.reported_inputs()}
    for step in BASES[name].steps:
        inputs = {each: known[each] for each in bases_of(step)}
        record = record.with_step(done(step, inputs=inputs))
    assert lacks(record, INPUTS, NOON) == []


def test_what_a_person_said_is_not_taken_out_unseen(tmp_path):
    record = whole().with_reported_change("cables", NOON + timedelta(hours=1))
    write_commissioning(tmp_path, record)
    assert read_commissioning(tmp_path) == record
    path = tmp_path / NAME
    content = json.loads(path.read_text())
    content["told"] = {}
    path.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match="was changed at or before C0 "):
        read_commissioning(tmp_path)


def test_after_a_month_all_is_stale():
    late = NOON + timedelta(days=30, minutes=6)
    found = lacks(whole(), INPUTS, late)
    assert [lack.step for lack in found] == list(ORDER)
    assert lacks(whole(), INPUTS, late - timedelta(minutes=2)) == []


def test_a_record_of_the_future_does_not_count():
    found = lacks(whole(), INPUTS, NOON - timedelta(days=400))
    assert [lack.step for lack in found] == list(ORDER)


def test_a_step_that_failed_is_named_with_its_cause():
    record = whole().with_step(
        done(StepId.RAMPS, verdict="wrong", cause="joint 3 moves the other way")
    )
    with pytest.raises(PreflightError, match="C9 ramps: joint 3 moves the other way"):
        require(lacks(record, INPUTS, NOON))


def test_steps_beyond_the_gate_keep_nobody_from_driving():
    record = whole(*GATED)
    found = lacks(record, INPUTS, NOON)
    assert [str(lack.step) for lack in found] == ["C12", "C13", "C14"]
    require(found)


@pytest.mark.parametrize(
    ("value", "low", "high", "passes", "text"),
    [
        (1.25, None, 1.7, True, "travel 1.25 % (at most 1.7)"),
        (1.8, None, 1.7, False, "travel 1.8 % (at most 1.7)"),
        (0.5, 1.0, 2.0, False, "travel 0.5 % (at least 1 and at most 2)"),
        (0.5, None, None, True, "travel 0.5 %"),
    ],
)
def test_a_quantity_stands_beside_its_limits(value, low, high, passes, text):
    quantity = Measured(name="travel", value=value, unit="%", low=low, high=high)
    assert (quantity.is_within, quantity.text) == (passes, text)


# --- one of several -------------------------------------------------------------------


def test_every_terrain_keeps_its_own_container():
    first = done(StepId.CONTAINER, subject="S0")
    other = {**INPUTS, "terrain": "e" * 64}
    second = done(
        StepId.CONTAINER,
        subject="S10",
        inputs={name: other[name] for name in bases_of(StepId.CONTAINER)},
    )
    record = whole(*ORDER[:-2]).with_step(second).with_step(first)
    record = record.with_step(done(StepId.PLATE))
    assert [one.subject for one in record.steps if one.subject] == ["S0", "S10"]
    assert lacks(record, INPUTS, NOON, "S0") == []
    assert lacks(record, other, NOON, "S10") == []
    (stale,) = lacks(record, other, NOON, "S0")
    assert stale.text.startswith("C13 container of S0: stale: row of the terrain")
    (missing,) = lacks(record, INPUTS, NOON, "TF")
    assert missing.text == "C13 container of TF: not done"
    again = record.with_step(done(StepId.CONTAINER, subject="S0", cause="moved"))
    assert again.of(StepId.CONTAINER, "S0").cause == "moved"
    assert again.of(StepId.CONTAINER, "S10") is not None
