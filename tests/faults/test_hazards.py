"""The table of hazards is complete and names tests that exist."""

import ast
import re
from pathlib import Path

import pytest

from experiments.commissioning.procedure import STEPS
from tests.faults.expected import TABLE
from tests.faults.hazards import (
    OF_THE_COMPUTER,
    VERIFYING_STEPS,
    Mode,
    hazards,
    measured,
)

ROOT = Path(__file__).parents[2]
SIGNALS = {
    "joint position",
    "joint torque command",
    "safety mode",
    "pendant and e-stop",
    "F/T wrench",
    "host cycle",
    "console heartbeat",
    "recorder",
    "disk",
    "CAN bus",
    "contact force",
    "second command",
    "serial line",
    "zero",
    "friction calibration",
    "tool model",
    "wall clock",
}


def functions_of(path):
    tree = ast.parse((ROOT / path).read_text())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_every_arm_signal_is_checked_by_steps_in_use():
    assert set(VERIFYING_STEPS) | OF_THE_COMPUTER == SIGNALS
    assert not set(VERIFYING_STEPS) & OF_THE_COMPUTER
    assert all(set(steps) <= set(STEPS) and steps for steps in VERIFYING_STEPS.values())


def test_the_hazard_page_has_every_signal():
    page = (ROOT / "docs" / "hazards.md").read_text().lower()
    headed = " ".join(re.findall(r"^\*\*.*", page, re.MULTILINE))
    signals = {signal.lower().removesuffix(" heartbeat") for signal in SIGNALS}
    assert {signal for signal in signals if signal not in headed} == set()


def test_every_signal_has_every_kind_of_fault():
    found = {(row.signal, row.mode) for row in hazards()}
    assert found == {(signal, mode) for signal in SIGNALS for mode in Mode}


@pytest.mark.parametrize("row", hazards(), ids=lambda r: f"{r.signal}-{r.mode.value}")
def test_a_hazard_names_existing_tests_and_its_bound(row):
    assert row.tests
    for test in row.tests:
        path, name = test.split("::")
        assert name in functions_of(path), test
    assert measured(row)
    assert all((row.hazard, row.cause, row.detection, row.reaction))
    assert "|" not in row.hazard + row.cause + row.detection + row.reaction + row.bound


def test_every_fault_of_the_matrix_is_a_cause_of_some_hazard():
    named = {fault for row in hazards() for fault in row.faults}
    assert named <= set(TABLE)
    # A warning, or a motion caused by the person leading the arm, is not a lost signal.
    assert set(TABLE) - named == {
        "nothing",
        "hand-gone",
        "hold-dragged",
        "puck-hot",
        "puck-error",
        "reply-lost-3",
        "safety-speed",
        "safety-torque",
        "safety-voltage",
        "joint-limit",
        "foot-speed",
        "overspeed",
        "joint7-slip",
    }
