"""Lines that order the simulated hands at a served arm."""

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.operator.hand_orders import (
    HAND_WORDS,
    HandOrderError,
    HangOrder,
    PoseOrder,
    PushOrder,
    ReleaseOrder,
    StopOrder,
    TwistOrder,
    parse_hand_order,
)
from experiments.operator.pendant import Lines, Pendant, TimedPress, parse_script

S = 1_000_000_000
ZEROS = (0.0,) * 6


@pytest.mark.parametrize(
    ("line", "order"),
    [
        ("pose 0 -2 0 3.13 0 1.6 0 2.5", PoseOrder((0, -2, 0, 3.13, 0, 1.6, 0), 2.5)),
        ("Stop 4 HIGH", StopOrder(4, "high")),
        ("stop 1 low", StopOrder(1, "low")),
        ("hang 2", HangOrder(2.0)),
        ("unhang", HangOrder(0.0)),
        ("push 5 0 -1.5 0.6", PushOrder((5.0, 0.0, -1.5), 0.6)),
        ("twist -0.6 2", TwistOrder(-0.6, 2.0)),
        ("release", ReleaseOrder()),
    ],
)
def test_a_valid_line_is_parsed_into_its_order(line, order):
    assert parse_hand_order(line.split()) == order


@pytest.mark.parametrize("line", ["", "activate", "fly 1 2", "7 low"])
def test_other_lines_are_not_hand_orders(line):
    assert parse_hand_order(line.split()) is None


@pytest.mark.parametrize(
    ("line", "cause"),
    [
        ("pose 1 2 3", "expected pose q1"),
        ("pose 0 0 0 0 0 0 0 0", "0 is not within 0.1..600 s"),
        ("pose 0 90 0 0 0 0 0 2", "90 is not within -7..7 rad"),
        ("pose 0 nan 0 0 0 0 0 2", "nan is not within"),
        ("stop 8 low", "a joint 1..7"),
        ("stop 2 left", r"expected stop JOINT low\|high"),
        ("stop 2", "a joint 1..7"),
        ("hang", "expected hang KG"),
        ("hang two", "expected hang KG"),
        ("hang -1", "-1 is not within 0..20 kg"),
        ("unhang 2", "expected unhang"),
        ("push 1 2 3", "expected push FX FY FZ SECONDS"),
        ("push 1 2 900 1", "900 is not within -200..200 N"),
        ("twist 1", "expected twist N_M SECONDS"),
        ("twist 9 1", "9 is not within -4..4 N m"),
        ("release it", "expected release"),
    ],
)
def test_an_invalid_order_is_refused_with_its_cause(line, cause):
    with pytest.raises(HandOrderError, match=cause):
        parse_hand_order(line.split())


@given(st.sampled_from(HAND_WORDS), st.lists(st.text(max_size=8), max_size=9))
def test_any_line_is_an_order_or_refused(word, arguments):
    try:
        order = parse_hand_order([word, *arguments])
    except HandOrderError:
        return
    assert order is not None


def test_a_script_mixes_buttons_and_hands():
    script = "1 pose 0 0 0 0 0 0 0 2\nhang 2\n3.5 activate\n"
    assert parse_script(script) == (
        TimedPress(S, PoseOrder((*ZEROS, 0.0), 2.0)),
        TimedPress(S, HangOrder(2.0)),
        TimedPress(7 * S // 2, "activate"),
    )


def test_stdin_orders_the_hands_and_names_invalid_lines():
    read, write = os.pipe()
    pendant = Pendant(None, Lines(read), 0)
    os.write(write, b"stop 6 high\nhang much\nidle\n")
    assert pendant.due(0) == [StopOrder(6, "high"), "idle"]
    assert pendant.take_unknown() == ["'hang much' - expected hang KG"]
    os.close(write)
    os.close(read)
