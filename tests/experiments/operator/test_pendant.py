import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import SettingsError
from experiments.operator.pendant import (
    Lines,
    Pendant,
    TimedPress,
    parse_script,
    read_script,
)

S = 1_000_000_000


def test_a_script_has_times_and_buttons():
    script = "# a comment\nidle\n\n3.0 activate  # now\nestop\n4 quit\n"
    assert parse_script(script) == (
        TimedPress(0, "idle"),
        TimedPress(3 * S, "activate"),
        TimedPress(3 * S, "estop"),
        TimedPress(4 * S, "quit"),
    )


@pytest.mark.parametrize(
    "line",
    [
        "fly",
        "x activate",
        "-1 idle",
        "nan idle",
        "inf quit",
        "1e9 quit",
        "1 2 idle",
        "3",
        "3 pose 1 2",
        "hang",
        "stop 8 low",
    ],
)
def test_an_invalid_line_is_reported(line):
    with pytest.raises(SettingsError, match="line 2"):
        parse_script(f"1 idle\n{line}")


def test_decreasing_times_are_refused():
    with pytest.raises(SettingsError, match="line 2"):
        parse_script("2 idle\n1 activate")


@given(st.text(max_size=60))
def test_any_script_is_in_order_or_refused(text):
    try:
        presses = parse_script(text)
    except SettingsError:
        return
    assert list(presses) == sorted(presses, key=lambda press: press.after_ns)


@pytest.fixture
def pipe():
    read, write = os.pipe()
    with os.fdopen(read, "rb") as reader, os.fdopen(write, "wb", 0) as writer:
        yield reader.fileno(), writer


def test_only_complete_lines_are_taken(pipe):
    descriptor, writer = pipe
    lines = Lines(descriptor)
    assert lines.take() == []
    writer.write(b"acti")
    assert lines.take() == []
    writer.write(b"vate\nidle\n")
    assert lines.take() == ["activate", "idle"]


def test_a_last_line_without_an_end_counts_when_the_other_side_closes(pipe):
    descriptor, writer = pipe
    lines = Lines(descriptor)
    writer.write(b"quit")
    writer.close()
    assert lines.take() == []
    assert lines.take() == ["quit"]
    assert lines.is_ended


def test_an_endless_line_is_truncated(pipe):
    descriptor, writer = pipe
    lines = Lines(descriptor)
    for _ in range(100):
        writer.write(b"x" * 1000)
        lines.take()
    writer.write(b"\n")
    assert len(lines.take()[0]) < 1000


def test_stdin_presses_buttons_and_names_unknown_lines(pipe):
    descriptor, writer = pipe
    pendant = Pendant(None, Lines(descriptor), 0)
    writer.write(b"Activate\nfly\n idle \n")
    assert pendant.due(0) == ["activate", "idle"]
    (unknown,) = pendant.take_unknown()
    assert unknown.startswith("'fly' is none of activate, idle, estop, quit, pose")
    assert pendant.take_unknown() == []


def test_a_script_presses_buttons_at_its_times():
    script = parse_script("1 activate\n2 quit")
    pendant = Pendant(script, Lines(None), 10 * S)
    assert pendant.due(11 * S - 1) == []
    assert pendant.due(11 * S) == ["activate"]
    assert pendant.due(20 * S) == ["quit"]
    assert pendant.due(30 * S) == []


@pytest.mark.parametrize(("script", "pressed"), [(None, ["quit"]), ((), [])])
def test_the_end_of_a_terminal_quits_unless_there_is_a_script(script, pressed):
    master, terminal = os.openpty()
    os.write(master, b"\x04")  # Ctrl-D
    assert Pendant(script, Lines(terminal), 0).due(0) == pressed
    os.close(master)
    os.close(terminal)


def test_the_end_of_a_pipe_does_not_quit(pipe):
    descriptor, writer = pipe
    writer.write(b"idle\n")
    writer.close()
    pendant = Pendant(None, Lines(descriptor), 0)
    assert [pendant.due(0), pendant.due(1), pendant.due(2)] == [["idle"], [], []]


def test_a_terminal_of_another_process_group_is_not_read(monkeypatch):
    master, terminal = os.openpty()
    os.write(master, b"quit\n")
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp() + 1)
    lines = Lines(terminal)
    assert lines.take() == []
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())
    assert lines.take() == ["quit"]
    os.close(master)
    os.close(terminal)


@pytest.mark.parametrize(
    ("content", "why"), [(b"\xff\xfe", "not text"), (b"#" * 1_000_001, "1 MB")]
)
def test_a_script_that_is_too_large_or_not_text_is_refused(tmp_path, content, why):
    path = tmp_path / "presses.txt"
    path.write_bytes(content)
    with pytest.raises(SettingsError, match=why):
        read_script(path)


def test_a_script_is_read_from_its_file(tmp_path):
    path = tmp_path / "presses.txt"
    path.write_text("1 activate\n")
    assert read_script(path) == (TimedPress(1_000_000_000, "activate"),)
