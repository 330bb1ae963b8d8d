"""What a report says of arms whose commissioning left something open."""

from experiments.report.commissioned import uncommissioned

OPEN = "uncommissioned: C12 lock and clock: not done"


def recorded(name, *, simulated="false", **said):
    return name, {"trial": {"simulated": simulated}, "provenance": said}


def test_what_is_open_stands_once_for_all_its_trials():
    trials = [recorded(f"S001/T0{n}", commissioning=OPEN) for n in (1, 2, 3)]
    assert uncommissioned(trials) == [f"3 trials, S001/T01 to S001/T03: {OPEN}."]


def test_a_commissioned_arm_and_a_simulated_one_need_no_words():
    whole = recorded("S001/T01", commissioning="complete")
    assert uncommissioned([whole, recorded("S002/T01", simulated="true")]) == []


def test_a_recording_that_says_nothing_is_named():
    (words,) = uncommissioned([recorded("S001/T01")])
    assert words.startswith("S001/T01: ")
    assert "recorded without a commissioning" in words
