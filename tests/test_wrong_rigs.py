"""Every commissioning step detects a faulty rig, and every faulty rig is detected."""

import pytest

from experiments.commissioning.judging import LIMITS
from experiments.commissioning.procedure import STEPS
from fakes.world.wrong_rigs import catalogue
from tests.attacks.parameters import parameters
from tests.wrong_rigs import FOUND, REFUSED, WARNED, rig_attacks

# Quantities on the execution of a step, not on the rig.
OF_THE_WORK = {
    *("listened", "answered", "cycles", "seen", "active", "rocked", "turned"),
    *("corners", "flat", "pressed", "pulled"),
}
# Tested with synthetic data and held arms in tests/experiments/commissioning: a start
# refuses the rig, another quantity fails first, or only rig.toml is wrong.
OF_RECORDINGS = {
    *("load", "drawings", "error_frames", "module", "serials"),
    *("late", "jumps", "answer", "stop", "stays", "idles", "asleep"),
    *(
        "hung_scale",
        "hung_spread",
        "fitted",
        "hung_way",
        "rest",
        "ringing",
        "balance",
    ),
}
# Only in the daily check.
OF_THE_DAY = {"changed", "exchange", "zero", "hang_force", "hang_way", "drift"}
ROWS = [(name, finding) for name, row in FOUND.items() for finding in row]


def test_every_rig_of_the_catalogue_is_in_the_table():
    assert set(FOUND) == set(catalogue())
    assert all(finding.by for _, finding in ROWS)


def test_every_step_detects_a_faulty_rig():
    assert {finding.step for _, finding in ROWS} == set(STEPS)
    judged = {finding.step for _, finding in ROWS if finding.by != (REFUSED,)}
    assert judged == set(STEPS)


def test_every_quantity_detects_a_faulty_rig_or_is_tested_elsewhere():
    tripped = {key for _, finding in ROWS for key in finding.by} - {REFUSED, WARNED}
    assert tripped <= set(LIMITS)
    others = [OF_THE_WORK, OF_RECORDINGS, OF_THE_DAY]
    assert all(not tripped & group for group in others)
    assert set().union(tripped, *others) == set(LIMITS)


@pytest.mark.parametrize("row", parameters(rig_attacks()))
def test_a_faulty_rig_is_detected_as_listed_in_the_table(row, tmp_path):
    row.check(tmp_path)
