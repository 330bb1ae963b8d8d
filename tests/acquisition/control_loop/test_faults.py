import json

import pytest

from acquisition.control_loop.faults import (
    FAULTS,
    OK,
    Action,
    CircuitCauses,
    Fault,
    GuardVerdict,
    JointExcess,
    ReplySilence,
    from_plain,
    to_plain,
    verdict_for,
)

RECORDED_NAMES = {
    "estop",
    "pendant-idle",
    "can-silence",
    "replies-late",
    "safety-silent",
    "position-jump",
    "motor-stuck",
    "motor-still",
    "bus-shared",
    "puck-changed",
    "puck-disobeys",
    "puck-doubled",
    "not-asked-active",
    "arm-not-active",
    "activation-motion",
    "hold-motion",
    "damp-motion",
    "proof-motion",
    "kinetic-energy",
    "not-a-number",
    "joint-limit",
    "overspeed",
    "foot-speed",
    "torque-limit",
    "joint7-slip",
    "ft-stale",
    "ft-saturated",
    "contact-force",
    "contact-moment",
    "contact-growth",
    "contact-move",
    "loop-late",
    "loop-lost",
    "move-refused",
    "console-silent",
    "console-lost",
    "recorder-silent",
}


def test_recorded_fault_names_are_stable():
    assert {fault.value for fault in Fault} == RECORDED_NAMES


def test_every_fault_has_a_row_in_the_catalogue():
    assert set(FAULTS) == set(Fault)


@pytest.mark.parametrize("fault", Fault)
def test_the_reaction_to_a_lasting_fault_is_not_milder(fault):
    first, lasting = verdict_for(fault), verdict_for(fault, is_lasting=True)
    assert 0 < first.severity <= lasting.severity


@pytest.mark.parametrize("fault", Fault)
def test_a_session_continues_unless_the_arm_may_be_idle(fault):
    verdict = verdict_for(fault, is_lasting=True)
    assert verdict.ends_session is (verdict.action is Action.IDLE)


def test_the_absence_of_a_fault_ends_no_session():
    assert (OK.reason, OK.ends_session, OK.severity) == ("", False, 0)


def test_a_verdict_without_a_fault_round_trips_through_json():
    assert from_plain(to_plain(OK)) == OK


@pytest.mark.parametrize(
    "verdict",
    [
        verdict_for(Fault.E_STOP, CircuitCauses(("torque", "voltage"))),
        verdict_for(Fault.JOINT_LIMIT, JointExcess(3, 2.9, 2.8)),
        verdict_for(Fault.CAN_SILENCE, ReplySilence(10.0, 0x41), is_lasting=True),
    ],
    ids=lambda verdict: verdict.reason,
)
def test_a_verdict_round_trips_through_json(verdict):
    assert from_plain(json.loads(json.dumps(to_plain(verdict)))) == verdict


def test_an_unknown_fault_name_is_refused():
    with pytest.raises(ValueError, match="no-fault"):
        from_plain(["hold", "no-fault", {}])


def test_actions_are_ordered_by_severity():
    order = (Action.NONE, Action.END_TRIAL, Action.HOLD, Action.DAMP, Action.IDLE)
    assert [GuardVerdict(action).severity for action in order] == [0, 1, 2, 3, 4]
