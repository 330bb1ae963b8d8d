"""Every message that states a cause has evidence and a test that shows the cause.

A refusal states what was observed; its hint asks about possible causes. The messages
listed here state the cause itself. Those of imported logs are listed in
tests/analysis/logs/test_refusals.py, those of the guard in the fault matrix.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("acquisition", "analysis", "experiments", "ft_sensor", "wam")
GUESSES = ("probably", "perhaps", "likely", "maybe", "apparently")

# (module, words of the message): (evidence of the cause, the test that shows it)
CAUSES = {
    ("wam/driver/discovery.py", "has left the bus after too many errors"): (
        "an error frame with the bus-off bit",
        "wam/driver/test_lost_replies.py::"
        "test_a_bus_off_controller_is_reported_until_the_arm_answers",
    ),
    ("wam/driver/discovery.py", "No device on the CAN bus acknowledges"): (
        "an error frame with the no-acknowledgement bit",
        "wam/driver/test_lost_replies.py::test_an_unacknowledged_host_fills_its_queue",
    ),
    ("wam/driver/discovery.py", "its pucks have no power"): (
        "the module answers MODE = 0 and no puck answers",
        "wam/driver/test_startup.py::test_a_stopped_arm_is_not_waited_for",
    ),
    ("wam/driver/safety_module.py", "a puck has lost its position"): (
        "a puck in reset, and ZERO read back as 1 after 0 was written",
        "wam/driver/test_lost_writes.py::test_no_start_reports_a_lost_zero_as_zeroed",
    ),
    ("wam/driver/arm.py", "replies came after the next request"): (
        "the count of replies in cycles without a request",
        "wam/driver/test_late_replies.py::"
        "test_a_start_reports_late_positions_as_late_and_not_missing",
    ),
    ("wam/driver/startup.py", "obeys torques although the arm is idle"): (
        "MODE of the puck while the module answers idle",
        "wam/driver/test_lost_writes.py::"
        "test_a_puck_in_torque_mode_in_an_idle_arm_is_idled_or_refused",
    ),
    ("wam/driver/startup.py", "number P or T differently"): (
        "the property tables of the firmware versions read from the pucks",
        "wam/driver/test_generations.py::"
        "test_pucks_that_cannot_share_a_torque_frame_are_refused",
    ),
    ("wam/driver/arm.py", "sends more replies than there are requests"): (
        "replies counted against requests",
        "wam/driver/test_lost_replies.py::"
        "test_an_arm_with_a_duplicated_puck_is_not_started",
    ),
    ("wam/model/moments.py", "to be zeroed"): (
        "a fit with that joint's zero free is better by over four standard deviations",
        "experiments/calibration/test_gravity.py::"
        "test_an_arm_that_was_zeroed_elsewhere_is_refused_with_the_joint",
    ),
    ("experiments/run/pose_walk.py", "Something pushed the foot"): (
        "the sensor's force less the foot's weight",
        "experiments/calibration/test_gravity.py::"
        "test_a_calibration_with_a_hand_on_the_foot_is_refused",
    ),
    ("ft_sensor/calibration/fit.py", "has the opposite sign in the sensor"): (
        "the fitted mass is negative at the stated mounting",
        "ft_sensor/calibration/test_fit.py::"
        "test_an_inverted_weight_is_refused_if_the_mounting_is_stated",
    ),
    ("ft_sensor/calibration/fit.py", "do not change with the orientation"): (
        "the fitted mass is not above zero",
        "ft_sensor/calibration/test_fit.py::test_readings_without_weight_are_refused",
    ),
    ("ft_sensor/calibration/fit.py", "too similar"): (
        "the condition number of the orientations",
        "ft_sensor/calibration/test_fit.py::test_similar_orientations_are_refused",
    ),
    ("ft_sensor/serial_line/startup.py", "stands still"): (
        "device times of a whole check are equal",
        "ft_sensor/vendors/test_bota_sensor.py::"
        "test_a_stopped_device_clock_is_refused_at_start",
    ),
    ("ft_sensor/vendors/bota_device.py", "raw gauge data or absurd forces"): (
        "the status bit, or forces beyond the stated limits",
        "ft_sensor/vendors/test_bota_sensor.py::"
        "test_a_matrix_that_stays_inactive_is_refused",
    ),
    ("analysis/data/inertia.py", "show no acceleration"): (
        "the median period of the samples against the window",
        "analysis/data/test_inertia.py::test_samples_that_show_no_acceleration_are_refused",
    ),
    ("analysis/tables/other_formats.py", "this is an Excel workbook"): (
        "its first bytes, or [Content_Types].xml in its archive",
        "borders/test_borders.py::test_a_foreign_input_is_read_exactly_flagged_or_refused",
    ),
    ("acquisition/ipc/layout.py", "runs another version of this program"): (
        "size and digest of the layout in the other process's memory",
        "experiments/commands/live/test_watching.py::"
        "test_memory_of_another_version_is_refused",
    ),
}


def functions_of(path: Path) -> set[str]:
    tree = ast.parse(path.read_text())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def sentences() -> Iterator[tuple[Path, str]]:
    """Every text that an error or a message begins with."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text())):
                name = getattr(getattr(node, "func", None), "id", "")
                if name.endswith("Error") and node.args:
                    yield path, ast.unparse(node.args[0])


@pytest.mark.parametrize("row", CAUSES, ids=" ".join)
def test_a_stated_cause_is_in_the_code_and_its_test_exists(row):
    module, words = row
    _, test = CAUSES[row]
    assert words in ast.unparse(ast.parse((ROOT / module).read_text()))
    path, name = test.split("::")
    assert name in functions_of(ROOT / "tests" / path)


def test_no_refusal_contains_a_guess():
    guessed = [
        (path.name, text)
        for path, text in sentences()
        if any(word in text.lower() for word in GUESSES)
    ]
    assert guessed == []
