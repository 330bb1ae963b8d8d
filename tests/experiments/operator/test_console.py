"""On a terminal, console lines wrap between words."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.operator.console import Console, wrapped


def test_a_line_is_broken_between_words_and_indented():
    text = " x preflight      one two three four"
    assert wrapped(text, 26, " " * 18) == (
        " x preflight      one two\n" + " " * 18 + "three\n" + " " * 18 + "four"
    )


def test_a_path_longer_than_the_terminal_stays_whole():
    path = "/data/" + "x" * 40 + "-y/events.jsonl"
    assert path in wrapped(f"Log: {path}", 30).split("\n")


@pytest.mark.parametrize("width", [58, 60, 62, 64, 80])
@pytest.mark.parametrize("state", ["holding", "UNKNOWN - support it", "damping"])
def test_the_state_of_the_arm_stays_on_the_line_of_its_label(width, state):
    text = f"T02 stopped at 2.0 s: F/T sample 21 ms old (limit 20). ARM: {state}. Push."
    lines = wrapped(text, width).split("\n")
    assert " ".join(lines) == text
    assert any(f"ARM: {state.split()[0]}" in line for line in lines)


@given(st.lists(st.text("abc,.-", min_size=1, max_size=9)), st.integers(12, 90))
def test_every_word_stays_whole_and_in_order(words, width):
    assert wrapped(" ".join(words), width).split() == words


def test_without_a_terminal_a_long_line_stays_one_line(capsys):
    Console().say("word " * 40)
    assert capsys.readouterr().out.count("\n") == 1


def test_a_closed_console_is_noticed(monkeypatch):
    class Closed:
        def write(self, _):
            raise BrokenPipeError

        def flush(self):
            raise BrokenPipeError

        def isatty(self):
            return False

    monkeypatch.setattr("sys.stdout", Closed())
    monkeypatch.setattr("experiments.operator.console.discard", lambda _: None)
    console = Console()
    assert not console.is_lost
    console.say("anybody?")
    assert console.is_lost
    console.say("nobody")
