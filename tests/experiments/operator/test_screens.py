import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from experiments.operator.keys import screen_keys
from experiments.operator.prompts import Prompt
from experiments.operator.screens import (
    ReadyView,
    RecordingView,
    ready_lines,
    recording_lines,
    sparkline,
)


def recording(**changed):
    values = {
        "trial": "T04",
        "seconds": 7.4,
        "displacement": 0.21,
        "travel": 0.45,
        "rate": 500.0,
        "missed": 0,
        "is_arm_fine": True,
        "is_sensor_fine": True,
        "traction": np.array([[0.0, 1.0, 4.0], [0.018, 9.8, 4.2]]),
    }
    return RecordingView(**(values | changed))


def ready(**changed):
    values = {
        "session": "S012",
        "terrain": "S10",
        "trial": 4,
        "wanted": 10,
        "kept": 3,
        "rejected": 1,
        "elapsed": 760.0,
        "left": 1773.0,
        "reset": ("rake", "level"),
        "suggestion": "slower than 0.05 m/s, pressing harder",
    }
    return ReadyView(**(values | changed))


def test_enough_trials_are_said_below_the_suggestion():
    told = "two more trials would move the grid by 0.4 N, trials differ by 1.2 N"
    assert f"Enough: {told}" == ready_lines(ready(enough=told))[-1]
    assert not [line for line in ready_lines(ready()) if line.startswith("Enough")]


def test_a_running_trial_shows_time_way_cadence_and_newest_forces():
    top, values, keys = recording_lines(recording(), 80)
    assert top == (
        "● REC T04  07.4 s  0.21 of 0.45 m  500.0 Hz  missed 0   CAN ok   F/T ok"
    )
    assert values.startswith("F_n ")
    assert "4.2 N   F_t " in values
    assert "9.8 N   v_t " in values
    assert values.endswith(" 0.018 m/s")
    assert "[space] stop early" in keys


def test_a_silent_motor_or_a_stale_sensor_is_marked():
    top = recording_lines(recording(is_arm_fine=False), 80)[0]
    assert "CAN ✘   F/T ok" in top
    top = recording_lines(recording(is_sensor_fine=False), 80)[0]
    assert "CAN ok   F/T ✘" in top


@pytest.mark.parametrize("width", [80, 120, 200])
def test_the_screen_fits_its_terminal(width):
    traction = np.full((2500, 3), -88.888)
    lines = recording_lines(recording(traction=traction, seconds=29.9), width)
    assert max(map(len, lines)) <= max(width, 88)


def test_a_wide_terminal_shows_longer_lines():
    narrow = recording_lines(recording(traction=np.ones((500, 3))), 80)[1]
    wide = recording_lines(recording(traction=np.ones((500, 3))), 200)[1]
    assert len(wide) - len(narrow) == 3 * 30


def test_a_trial_that_has_just_begun_is_shown_too():
    assert recording_lines(recording(traction=np.empty((0, 3))), 80)[1].startswith(
        "F_n"
    )


def test_a_ramp_becomes_a_ramp():
    assert sparkline(np.arange(8.0), 8) == "▁▂▃▄▅▆▇█"


def test_a_short_slip_shows_in_a_long_line():
    values = np.zeros(2500)
    values[1234] = 0.3
    assert sparkline(values, 10).count("█") == 1


@given(arrays(np.float64, st.integers(0, 300)), st.integers(1, 60))
def test_a_sparkline_has_its_width_whatever_the_numbers(values, width):
    assert len(sparkline(values, width)) == width


def test_the_ready_screen_tells_where_the_session_stands():
    top, clock, reset, suggestion = ready_lines(ready())
    assert top.startswith("S012 S10 · trial 4 of 10 · kept 3 · rejected 1")
    assert top.endswith("ARM: floating")
    assert clock == "Elapsed 12:40 · left about 30 min"
    assert reset == "Reset: ☐ rake ☐ level"
    assert suggestion == "Suggested next: slower than 0.05 m/s, pressing harder"


def test_before_the_first_trial_nothing_is_guessed():
    _, clock = ready_lines(ready(left=None, reset=(), suggestion=""))
    assert clock == "Elapsed 12:40"


def test_the_ready_screen_fits_eighty_columns():
    lines = ready_lines(ready(trial=10, kept=9, rejected=99, elapsed=35999.0))
    assert max(map(len, [*lines, screen_keys(Prompt.READY)])) <= 80
