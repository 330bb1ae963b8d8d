from dataclasses import fields
from pathlib import Path

import pytest

from acquisition.control_loop.faults import (
    FAULTS,
    Action,
    CircuitCauses,
    Fault,
    verdict_for,
)
from experiments.messages import (
    CATALOGUE,
    FaultContext,
    Message,
    catalogue_table,
    fault_text,
)
from tests.experiments.program import traction

PAGE = Path(__file__).parents[2] / "docs" / "messages.md"
HEAD = "| message | what you read | the arm | what to do |"


def test_the_table_of_the_page_is_that_of_the_catalogue():
    lines = PAGE.read_text().splitlines()
    table = catalogue_table()
    begin = lines.index(HEAD)
    assert lines[begin : begin + len(table)] == table
    assert not any(line.startswith("|") for line in lines[begin + len(table) :])


def test_the_whole_catalogue_can_be_explained():
    done = traction("check", "--explain", "all")
    assert done.code == 0
    assert done.out.splitlines() == catalogue_table()
    assert len(done.out.splitlines()) == len(CATALOGUE) + 2


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_row_says_what_happened_and_more_and_breaks_no_table(name):
    message = CATALOGUE[name]
    what, do = message.sample()
    assert what.strip(" ….")
    assert message.more.endswith(".")
    assert not message.arm.endswith(".")
    assert "|" not in what + message.arm + do
    assert "{" not in what + do


def test_exit_codes_are_those_that_the_help_explains():
    assert {message.exit_code for message in CATALOGUE.values()} <= {
        *range(7),
        130,
    }


def test_what_is_filled_in_is_left_open_in_a_table():
    message = Message("{n:.0f} of {m} at T{k:02d}.", "Wait {s} s.", 0, "")
    assert message.sample() == ("… of … at T….", "Wait … s.")
    assert message.text({"n": 2.4, "m": 3, "k": 4, "s": 5}, "All safe.") == (
        "2 of 3 at T04. Wait 5 s. All safe."
    )


ARM_TEXTS = {
    Action.END_TRIAL: ("holding",),  # as soon as the console has heard of it
    Action.HOLD: ("holding",),
    Action.DAMP: ("damping, then holding",),
    Action.IDLE: ("idle", "stopped by its hardware", "UNKNOWN"),
}


@pytest.mark.parametrize("fault", Fault)
def test_the_message_of_a_fault_says_what_the_guard_makes_the_arm_do(fault):
    message, spec = CATALOGUE[fault.value], FAULTS[fault]
    assert message.exit_code == 4
    assert message.arm.startswith(ARM_TEXTS[spec.actions[-1]])


@pytest.mark.parametrize("fault", Fault)
def test_the_numbers_of_a_fault_fill_its_message(fault):
    detail = FAULTS[fault].detail
    numbers = () if detail is CircuitCauses else (7 for _ in fields(detail))
    text = fault_text(verdict_for(fault, detail(*numbers)), FaultContext("T03", 1.5))
    assert "{" not in text
    assert CATALOGUE[fault.value].arm in text or fault is Fault.CAN_SILENCE
