"""A report names recordings of arms whose commissioning is not complete."""

from experiments.report.commissioned import uncommissioned

OPEN = "uncommissioned: C12 lock and clock: not done"


def recorded(name, *, simulated="false", **provenance):
    return name, {"trial": {"simulated": simulated}, "provenance": provenance}


def test_an_open_step_is_reported_once_for_all_its_trials():
    trials = [recorded(f"S001/T0{n}", commissioning=OPEN) for n in (1, 2, 3)]
    assert uncommissioned(trials) == [f"3 trials, S001/T01 to S001/T03: {OPEN}."]


def test_a_commissioned_and_a_simulated_arm_are_not_named():
    whole = recorded("S001/T01", commissioning="complete")
    assert uncommissioned([whole, recorded("S002/T01", simulated="true")]) == []


def test_a_recording_without_a_commissioning_is_reported():
    (words,) = uncommissioned([recorded("S001/T01")])
    assert words.startswith("S001/T01: ")
    assert "recorded without a commissioning" in words
