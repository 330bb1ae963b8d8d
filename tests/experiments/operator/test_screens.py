import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from experiments.operator.graphs import (
    BarScale,
    KeptRow,
    LiveScales,
    TravelTrace,
    fitted,
    kept_table,
    packed,
    sparkline,
    trace_lines,
)
from experiments.operator.keys import STOP_KEYS, screen_keys
from experiments.operator.prompts import Prompt
from experiments.operator.screens import (
    ReadyView,
    RecordingView,
    ready_lines,
    recording_lines,
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
        "scales": LiveScales((0.005, 0.2)),
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
        "thin": "slower than 0.05 m/s, above 5 N",
    }
    return ReadyView(**(values | changed))


def test_a_running_trial_shows_time_travel_rate_and_newest_forces():
    top, F_n, F_t, v_t, keys, stop = recording_lines(recording(), 80)
    assert top == (
        "● REC T04  07.4 s  0.21 of 0.45 m  500.0 Hz  missed 0  CAN ok  F/T ok"
    )
    assert F_n.startswith("F_n 0")
    assert F_n.endswith("100       4.2 N  in 0..30")
    assert F_t.endswith("100       9.8 N  in 0..60")
    assert v_t.endswith("0.8   0.018 m/s  in 0.005..0.2")
    assert keys == "[space] stop early"
    assert stop == "Ctrl-C finish safely, twice = stop now"


def test_a_push_outside_its_band_is_marked():
    fast = np.array([[0.25, 70.0, 31.0]])
    _, F_n, F_t, v_t, *_ = recording_lines(recording(traction=fast), 80)
    assert F_n.endswith("31.0 N  ▲ above 0..30")
    assert F_t.endswith("70.0 N  ▲ above 0..60")
    assert v_t.endswith("0.250 m/s  ▲ above 0.005..0.2")
    slow = np.array([[0.001, 1.0, np.nan]])
    _, F_n, _, v_t, *_ = recording_lines(recording(traction=slow), 80)
    assert F_n.endswith("▲ unknown, band 0..30")
    assert v_t.endswith("below 0.005..0.2")


def test_a_silent_motor_or_a_stale_sensor_is_marked():
    top = recording_lines(recording(is_arm_fine=False), 80)[0]
    assert "CAN ✘  F/T ok" in top
    top = recording_lines(recording(is_sensor_fine=False), 80)[0]
    assert "CAN ok  F/T ✘" in top


@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_the_screen_fits_its_terminal(width):
    traction = np.full((2500, 3), -88.888)
    lines = recording_lines(recording(traction=traction, seconds=29.9), width)
    shown = fitted(lines, width, 19)
    assert max(map(len, shown)) <= width
    assert "CAN ok  F/T ok" in "\n".join(shown)
    assert shown[-2:] == ["[space] stop early", STOP_KEYS]


def test_a_wide_terminal_shows_longer_lines():
    narrow = recording_lines(recording(traction=np.ones((500, 3))), 80)[1]
    wide = recording_lines(recording(traction=np.ones((500, 3))), 100)[1]
    assert len(narrow) == 79
    assert len(wide) == 90


def test_a_trial_that_has_just_begun_is_shown_too():
    assert recording_lines(recording(traction=np.empty((0, 3))), 80)[1].startswith(
        "F_n"
    )


SCALE = BarScale(64.0, 0.0, 30.0, "N", ".1f")


@pytest.mark.parametrize("value", [-0.04, 0.04, -0.0])
def test_a_number_that_rounds_to_zero_has_no_sign(value):
    assert SCALE.number(value) == "0.0 N"
    assert SCALE.number(-0.06) == "-0.1 N"


def test_the_scale_of_a_sparkline_is_fixed_and_shows_small_values():
    assert sparkline(np.array([0.0, 1.0, 6.4, 16.0, 36.0, 64.0, 640.0]), 7, SCALE) == (
        "▁▂▃▅▆██"
    )
    assert sparkline(np.full(7, 1.0), 7, SCALE) == "▂" * 7


def test_the_last_bar_is_the_newest_value_not_an_earlier_peak():
    values = np.concatenate((np.full(2499, 64.0), [0.0]))
    assert sparkline(values, 10, SCALE) == "█" * 9 + "▁"


def test_a_short_slip_shows_in_a_long_line():
    values = np.zeros(2500)
    values[1234] = 64.0
    assert sparkline(values, 10, SCALE).count("█") == 1


def test_nan_leaves_its_bar_empty():
    assert sparkline(np.array([64.0, np.nan, 64.0]), 3, SCALE) == "█ █"


@given(arrays(np.float64, st.integers(0, 300)), st.integers(1, 60))
def test_a_sparkline_has_its_width_whatever_the_numbers(values, width):
    assert len(sparkline(values, width, SCALE)) == width


def test_the_ready_screen_shows_progress_times_and_reset():
    top, clock, reset, thin = ready_lines(ready())
    assert top == ("ARM: floating  S012 S10 · trial 4 of 10 · kept 3 · rejected 1")
    assert clock == "Elapsed 12:40 · left about 30 min"
    assert reset == "Reset (its digit ticks a step):  1 ☐ rake  2 ☐ level"
    assert thin == "Thin so far: slower than 0.05 m/s, above 5 N"


def test_no_remaining_time_is_shown_without_an_estimate():
    _, clock = ready_lines(ready(left=None, reset=(), thin=""))
    assert clock == "Elapsed 12:40"


def test_the_ready_screen_fits_eighty_columns():
    lines = ready_lines(ready(trial=10, kept=9, rejected=99, elapsed=35999.0))
    assert max(map(len, [*lines, screen_keys(Prompt.READY)])) <= 80


def test_a_ticked_step_has_a_full_box():
    line = ready_lines(ready(ticked=frozenset({2})))[2]
    assert line.endswith("1 ☐ rake  2 ☑ level")


def test_a_verdict_is_shown_while_it_can_be_undone():
    given_ = ready_lines(ready(given="T03 kept", undo_left=6.2))[-1]
    assert given_ == "T03 kept.  [u]ndo (7 s)"
    later = ready_lines(ready(given="T03 kept", undo_left=0.0))
    assert not [line for line in later if "[u]ndo" in line]


ROWS = [
    KeptRow("T01", 0.0312, 0.62, 6, ""),
    KeptRow("T02", None, None, None, "dry stones, wind " * 9),
]


@pytest.mark.parametrize("width", [60, 80])
def test_the_running_table_has_a_row_for_each_kept_trial(width):
    head, first, second = kept_table(ROWS, width, 10)
    assert head.split() == ["kept", "v_t", "[m/s]", "F_t/F_n", "slips", "remark"]
    assert first.split() == ["T01", "0.031", "0.62", "6"]
    assert second.split()[:5] == ["T02", "?", "?", "?", "dry"]
    assert len(second) == width
    assert second.endswith("…")


def test_a_long_table_keeps_the_newest():
    head, *rows = kept_table(ROWS * 6, 80, 10)
    assert "(2 earlier)" in head
    assert len(rows) == 10


def test_a_panel_breaks_between_keys_and_keeps_first_and_last_lines():
    lines = ["ARM: floating  S012", *map(str, range(40)), "[a]  [b]", "[c] d  [e] f"]
    shown = fitted(lines, 12, 10)
    assert shown[:2] == ["ARM:", "floating"] or shown[0] == "ARM: floating"
    assert shown[-2:] == ["[a]  [b]", "[c] d  [e] f"]
    assert len(shown) == 10
    assert "…" in shown


@pytest.mark.parametrize("prompt", [Prompt.READY, Prompt.REVIEW, Prompt.RECORDING])
@pytest.mark.parametrize("width", [40, 60, 80])
def test_no_key_is_broken_across_lines(prompt, width):
    parts = [part.strip() for part in screen_keys(prompt).split("  ")]
    shown = packed(screen_keys(prompt), width).split("\n")
    assert max(map(len, shown)) <= width
    assert all(any(part in line for line in shown) for part in parts)


def test_a_trace_is_shown_above_the_median_of_the_kept_ones():
    own = TravelTrace("F_t", "N", np.array([0.0, 7.0, np.nan, 14.0]))
    kept = [np.array([7.0, 7.0, 7.0, np.nan]), np.array([7.0, 0.0, 7.0, np.nan])]
    words, mine, theirs = trace_lines(own, [*kept, np.zeros(9)], "T03", 80)
    assert words == "F_t over displacement, full bar 14.0 N; kept: median of 2"
    assert mine == " T03  ▁▅ █"
    assert theirs == " kept ▅▃▅ "


@pytest.mark.parametrize("width", [60, 80])
def test_a_trace_fills_the_terminal_and_not_more(width):
    own = TravelTrace("v_t", "m/s", np.linspace(0.0, 0.5, 72))
    lines = trace_lines(own, [own.values], "T03", width)
    assert max(map(len, lines)) == (width if width < 78 else 78)
