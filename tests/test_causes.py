"""Every message that states a cause has evidence and a test that shows the cause.

A refusal states what was observed; its hint asks about possible causes. The messages
listed here state the cause itself. All refusals of imported logs are listed in
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
    ("analysis/logs/opening.py", "the recording is duplicated"): (
        "count of messages and checksum of receipts and bytes are equal in two files",
        "analysis/logs/test_channels.py::test_a_duplicated_recording_is_reported",
    ),
    ("analysis/logs/sqlite_log.py", "shows a transaction that has not ended"): (
        "the first byte of the journal beside it is not zero",
        "analysis/logs/test_channels.py::test_a_hot_journal_is_refused_by_its_name",
    ),
    ("analysis/logs/bag_log.py", "the file is cut there"): (
        "it ends before the size that a record states",
        "analysis/logs/test_log_formats.py::test_a_truncated_log_is_read_to_its_end",
    ),
    ("analysis/logs/robot.py", "m long, the limit is"): (
        "the sum of the lengths between the first joint and the foot",
        "analysis/logs/test_robot.py::test_a_urdf_in_millimetres_is_refused_wherever_its_robot_stands",
    ),
    ("analysis/logs/robot.py", "it holds xacro:"): (
        "an element in the namespace of xacro",
        "analysis/logs/test_robot.py::test_a_hostile_urdf_is_refused",
    ),
    ("analysis/logs/clocks.py", "two clocks: by the receipts"): (
        "offsets of both lines through receipt less stamp",
        "analysis/logs/test_clocks.py::test_offset_clocks_are_refused_with_both_remedies",
    ),
    ("analysis/logs/clocks.py", "ms over the log (limit"): (
        "slope of the line with its 95 % interval",
        "analysis/logs/test_clocks.py::test_a_sensor_clock_that_runs_fast_is_reported_with_its_drift",
    ),
    ("analysis/logs/clocks.py", "after its first message (limit"): (
        "a lasting step of the fastest messages",
        "analysis/logs/test_clocks.py::test_a_clock_set_during_the_log_is_refused",
    ),
    ("analysis/logs/signs.py", "have the opposite sign"): (
        "shares of rows with F_n < 0 and with F_t along the motion",
        "analysis/logs/test_importing.py::test_forces_of_the_opposite_sign_are_refused_with_the_remedy",
    ),
    ("analysis/logs/signs.py", "These forces cannot come from the ground"): (
        "shares of rows of both signs",
        "analysis/logs/test_importing.py::test_forces_of_the_opposite_sign_are_refused_with_the_remedy",
    ),
    ("analysis/logs/channels.py", "unlike those before and after them"): (
        "exact zeros over 20 mrad from both neighbours",
        "analysis/logs/test_channels.py::test_joint_states_of_zeros_are_reported_and_omitted",
    ),
    ("analysis/logs/importing.py", "unchanged reading for"): (
        "six equal numbers for 0.2 s and 20 usual readings",
        "analysis/logs/test_channels.py::test_a_constant_channel_is_omitted_and_reported",
    ),
    ("analysis/logs/importing.py", "rows have no reading of the wrench"): (
        "rows of the trial without a message near",
        "analysis/logs/test_importing.py::test_a_wrench_that_ends_in_a_trial_is_reported",
    ),
    ("analysis/logs/checks.py", "v_t is wrong by this distance"): (
        "the fit of moments to a force that turns, and the turn of the foot",
        "analysis/logs/test_importing.py::test_a_foot_frame_above_the_sole_is_shown_by_the_moments",
    ),
    ("analysis/logs/checks.py", "show no offset"): (
        "a topic has no line of receipt less stamp",
        "analysis/logs/test_importing.py::test_a_lag_is_not_compared_with_clocks_that_are_unknown",
    ),
    ("analysis/tables/checks.py", "rows have the time of the row before"): (
        "the count of equal times, over half of the rows",
        "borders/test_borders.py::test_a_foreign_input_is_read_exactly_flagged_or_refused",
    ),
    ("analysis/tables/checks.py", "The times fall back to their start"): (
        "the time is in the first half of the step from the first row",
        "borders/test_borders.py::test_a_foreign_input_is_read_exactly_flagged_or_refused",
    ),
    ("analysis/tables/text.py", "this is not UTF-8 text"): (
        "a zero byte, with its line",
        "borders/test_borders.py::test_a_foreign_input_is_read_exactly_flagged_or_refused",
    ),
    ("analysis/tables/text.py", "the names of the columns are in line"): (
        "a later line that holds every name",
        "borders/test_borders.py::test_a_foreign_input_is_read_exactly_flagged_or_refused",
    ),
    ("analysis/tables/loading.py", "Save all tables with one unit of it"): (
        "the units in the headers of two files",
        "analysis/tables/test_further_inputs.py::test_a_further_column_of_two_units_is_refused",
    ),
    ("experiments/report/external_tables.py", "F_n is negative in"): (
        "the share of negative rows",
        "experiments/report/test_external_tables.py::test_a_negative_normal_force_is_refused_with_the_option",
    ),
    ("acquisition/errors.py", "which is not installed"): (
        "no such module is found",
        "experiments/test_extras.py::test_only_a_library_that_is_not_there_is_called_missing",
    ),
    ("acquisition/extras.py", "is installed and cannot be imported"): (
        "the module is found and its import raises",
        "experiments/test_extras.py::test_only_a_library_that_is_not_there_is_called_missing",
    ),
    ("analysis/study/worker_processes.py", "ended unexpectedly"): (
        "signal or exit code of the process",
        "analysis/study/test_tasks.py::test_a_worker_that_dies_is_reported_with_its_signal_and_replaced",
    ),
    ("experiments/report/study_report.py", "cannot be written"): (
        "what the system says of the folder",
        "experiments/report/test_report_elsewhere.py::test_a_folder_that_cannot_be_created_is_refused_before_any_fit",
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
