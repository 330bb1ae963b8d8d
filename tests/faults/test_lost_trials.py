"""A trial that cannot be written, and a fault of the arm in it: both are told."""

import re

import pytest

from experiments.rig.backend import InProcessBackend
from tests.experiments.program import run_short
from tests.sweeps import swept

LOSSES = {
    "write-failed@T1+0s": "T01 could not be verified",
    "disk-full@T1+0.9s": "cannot be written (File too large)",
}
FAULTS = (
    "estop@T1+1s",
    "pendant-idle@T1+1s",
    "can-silence@T1+1s",
    "puck-silent@T1+1s",
    "safety-silent@T1+0.7s",  # noticed after 250 ms
    "position-jump@T1+1s",
    "overspeed@T1+1s",
    "joint7-slip@T1+1s",
    "ft-stale@T1+1s",
)
PAIRS = [(loss, fault) for loss in LOSSES for fault in FAULTS]
QUICK = {
    ("write-failed@T1+0s", "overspeed@T1+1s"),
    ("disk-full@T1+0.9s", "estop@T1+1s"),
}


def states(text):
    """What is said of the arm, message by message, without remarks."""
    return [re.split("[:;,.]| -", said)[0] for said in re.findall("ARM: (.*)", text)]


def run(config, data, *faults):
    options = [word for fault in faults for word in ("--fault", fault)]
    return run_short(config, data, "TF", 1, *options)


@pytest.mark.parametrize(("loss", "fault"), swept(PAIRS, QUICK))
def test_a_lost_trial_hides_no_fault_of_the_arm(config, tmp_path, loss, fault):
    alone = run(config, tmp_path / "alone", fault)
    both = run(config, tmp_path / "both", loss, fault)
    assert LOSSES[loss] in both.err
    assert states(both.err) == states(alone.err)[:1]
    assert both.code == (alone.code or 6)


@pytest.mark.parametrize("loss", LOSSES)
def test_an_arm_that_holds_after_a_lost_trial_waits_for_its_person(
    config, tmp_path, loss
):
    done = run(config, tmp_path, loss)
    assert done.code == 6
    assert states(done.err) == ["holding"]
    assert "Support the arm: it goes idle and sinks slowly. [i]dle" in done.out


def test_a_lost_trial_does_not_claim_control_that_was_lost_too(
    config, tmp_path, monkeypatch
):
    lost = property(lambda backend: False)
    monkeypatch.setattr(InProcessBackend, "is_controlled", lost)
    done = run(config, tmp_path, "write-failed@T1+0s")
    assert done.code == 6
    assert states(done.err) == ["not under control"]
    assert "[i]dle" not in done.out
