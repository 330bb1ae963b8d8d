import re
from dataclasses import fields

import pytest

from acquisition.control_loop.details import JointExcess, ReplySilence
from acquisition.control_loop.faults import (
    FAULTS,
    Action,
    CircuitCauses,
    Fault,
    verdict_for,
)
from acquisition.control_loop.states import ArmState
from acquisition.errors import LinkTimeoutError, PreflightError, UnfitDeviceError
from experiments.__main__ import EXIT_CODES
from experiments.messages import (
    CATALOGUE,
    ComputerLoad,
    FaultContext,
    Message,
    catalogue_table,
    fault_text,
    preflight_error,
)
from experiments.preflight.connecting import as_preflight
from tests.experiments.program import traction


def test_the_whole_catalogue_can_be_explained():
    done = traction("check", "--explain", "all")
    assert done.code == 0
    assert done.out.splitlines() == catalogue_table()
    assert len(done.out.splitlines()) == len(CATALOGUE) + 2


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_message_has_all_its_parts_and_breaks_no_table(name):
    message = CATALOGUE[name]
    what, do = message.sample()
    assert what.strip(" ….")
    assert message.more.endswith(".")
    assert not message.arm.endswith(".")
    assert "|" not in what + message.arm + do
    assert "{" not in what + do


def test_exit_codes_are_those_that_the_help_explains():
    explained = {int(code) for code in re.findall(r"(?<!\w)\d+(?= )", EXIT_CODES)}
    assert {message.exit_code for message in CATALOGUE.values()} <= explained


def test_the_values_of_a_message_are_left_open_in_a_table():
    message = Message("{n:.0f} of {m} at T{k:02d}.", "Wait {s} s.", 0, "")
    assert message.sample() == ("… of … at T….", "Wait … s.")
    assert message.text({"n": 2.4, "m": 3, "k": 4, "s": 5}, "All safe.") == (
        "2 of 3 at T04. Wait 5 s. All safe."
    )


ARM_TEXTS = {
    Action.END_TRIAL: ("holding",),  # as soon as the console knows of the fault
    Action.HOLD: ("holding",),
    Action.DAMP: ("damped where it is",),
    Action.IDLE: ("idle", "stopped by its hardware", "UNKNOWN"),
}


@pytest.mark.parametrize("fault", Fault)
def test_the_message_of_a_fault_names_the_reaction_of_the_guard(fault):
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


@pytest.mark.parametrize("fault", Fault)
def test_a_fault_outside_a_session_names_the_command_to_repeat(fault):
    detail = FAULTS[fault].detail
    numbers = () if detail is CircuitCauses else (7 for _ in fields(detail))
    context = FaultContext(prompt=None, command="traction zero")
    text = fault_text(verdict_for(fault, detail(*numbers)), context)
    assert "{" not in text
    assert "resume" not in text
    do = CATALOGUE[fault.value].do
    assert ("traction zero" in text) is ("{then}" in do or "{command}" in do)


LOAD = ComputerLoad(8.7, 2)
SILENCE = verdict_for(Fault.CAN_SILENCE, ReplySilence(10.0, 0x7F))


def test_a_busy_computer_is_reported_first_and_no_cable_is_blamed():
    text = fault_text(SILENCE, FaultContext("T03", 1.5, load=LOAD))
    assert text.startswith(
        "This computer is too busy to simulate in real time (load 8.7, cores 2)."
    )
    assert "No reply from the arm for 10 ms." in text
    assert "ARM: UNKNOWN - support it" in text
    assert "--processes" in text
    assert "cable" not in text


def test_without_a_busy_computer_the_cable_is_reported():
    text = fault_text(SILENCE, FaultContext("T03", 1.5))
    assert "busy" not in text
    assert "Check the CAN cable" in text


def test_a_fault_unrelated_to_timing_is_not_blamed_on_the_computer():
    spec = FAULTS[Fault.OVERSPEED]
    detail = spec.detail(*(7 for _ in fields(spec.detail)))
    text = fault_text(
        verdict_for(Fault.OVERSPEED, detail), FaultContext("T03", 1.5, load=LOAD)
    )
    assert "busy" not in text


def test_a_refusal_names_a_busy_computer_instead_of_cables():
    error = UnfitDeviceError("Puck 5 does not answer.", hint="Check its cable.")
    refusal = LOAD.blamed(error)
    assert refusal.message.startswith("This computer is too busy")
    assert "Puck 5 does not answer." in refusal.message
    assert "cable" not in refusal.hint


def test_the_type_of_a_refusal_states_whether_a_device_is_unfit():
    lost = {"lost": 60, "cycles": 100}
    assert isinstance(preflight_error("exchange", **lost), UnfitDeviceError)
    assert not isinstance(preflight_error("loop-dead"), UnfitDeviceError)
    silent = LinkTimeoutError("Node 8 does not answer.", hint="Check its cable.")
    assert isinstance(as_preflight(silent, "idle"), UnfitDeviceError)
    full = PreflightError("2 GB free.", hint="Make room.")
    assert not isinstance(as_preflight(full, "idle"), UnfitDeviceError)


def test_a_computer_is_too_busy_where_programs_wait_for_a_core():
    assert LOAD.is_too_much
    assert not ComputerLoad(2.0, 2).is_too_much
    now = ComputerLoad.now()
    assert now.load >= 1.0  # this one runs
    assert now.cores >= 1


@pytest.mark.parametrize(
    ("fault", "state", "arm"),
    [
        (Fault.PENDANT_IDLE, ArmState.UNKNOWN, "UNKNOWN - support it"),
        (Fault.PENDANT_IDLE, ArmState.IDLE, "idle; it sinks slowly, support it"),
        (Fault.OVERSPEED, ArmState.IDLE, "idle; it sinks slowly, support it"),
        (Fault.OVERSPEED, ArmState.DAMP, "damped where it is, until you let it hold"),
    ],
)
def test_a_message_names_the_present_state_of_the_arm(fault, state, arm):
    details = {
        Fault.PENDANT_IDLE: CircuitCauses(),
        Fault.OVERSPEED: JointExcess(6, 5.0, 4.0),
    }
    text = fault_text(verdict_for(fault, details[fault]), FaultContext(state=state))
    assert f"ARM: {arm}." in text
