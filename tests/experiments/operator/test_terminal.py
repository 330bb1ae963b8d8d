import contextlib
import os
import pty
import pwd
import termios

import pytest

from experiments.operator.auto_operator import AutoOperator
from experiments.operator.keys import KEYS, KeyAction
from experiments.operator.prompts import Prompt, PromptState
from experiments.operator.terminal import LONGEST_LINE, Cbreak, TerminalInput, keyboard


@pytest.fixture
def terminal():
    """(the person's end, the program's end) of a pseudo-terminal."""
    person, program = pty.openpty()
    yield person, program
    for descriptor in (person, program):
        with contextlib.suppress(OSError):
            os.close(descriptor)


def asked(prompt=Prompt.REVIEW):
    return PromptState(prompt, 1, 1, True, 0.0)


def keys_of(terminal):
    person, program = terminal
    keys = TerminalInput(program)
    keys.answer(asked())  # the prompt is on the screen before anything is typed
    return person, keys


def test_the_operator_at_a_terminal_is_the_user_who_is_logged_in(terminal):
    name = pwd.getpwuid(os.getuid()).pw_name
    assert TerminalInput(terminal[1]).who == name
    assert AutoOperator().who == "auto"


def local_flags(descriptor):
    return termios.tcgetattr(descriptor)[3]


def test_a_key_counts_without_enter_and_is_not_echoed(terminal):
    person, program = terminal
    with Cbreak(program):
        keys = TerminalInput(program)
        keys.answer(asked())
        os.write(person, b"k")
        assert keys.answer(asked()) == "k"
        assert not local_flags(program) & (termios.ICANON | termios.ECHO)


@pytest.mark.parametrize("how", ["return", "raise", "twice"])
def test_the_terminal_settings_are_restored(terminal, how):
    _, program = terminal
    before = termios.tcgetattr(program)
    with contextlib.suppress(RuntimeError), Cbreak(program) as switched:
        assert termios.tcgetattr(program) != before
        if how == "raise":
            raise RuntimeError
        if how == "twice":
            switched.restore()
    assert termios.tcgetattr(program) == before


def test_a_closed_terminal_is_left_alone():
    person, program = pty.openpty()
    os.close(person)
    os.close(program)
    with Cbreak(program) as switched:
        switched.restore()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(program)


MS = 1_000_000


class Pressed:
    """Keys that arrive at given times [ms], as a terminal sends them."""

    def __init__(self, terminal):
        self.person, program = terminal
        self.now_ms = 0
        self.keys = TerminalInput(program, lambda: self.now_ms * MS)

    def press(self, key, now_ms, prompt):
        """Let `key` arrive; the answer at `prompt`."""
        self.now_ms = now_ms
        self.keys.answer(asked(prompt))  # which is on the screen before
        os.write(self.person, key)
        return self.keys.answer(asked(prompt))


@pytest.mark.parametrize("first_ms", [250, 500, 700])
@pytest.mark.parametrize("every_ms", [33, 100])
def test_a_key_that_is_held_answers_one_prompt(terminal, first_ms, every_ms):
    pressed = Pressed(terminal)
    with Cbreak(pressed.keys.descriptor):
        assert pressed.press(b" ", 0, Prompt.SUPPORT) == " "
        times = range(first_ms, 5000, every_ms)
        prompts = (Prompt.READY, Prompt.RECORDING, Prompt.REVIEW, Prompt.SUPPORT)
        for number, now_ms in enumerate(times):
            assert pressed.press(b" ", now_ms, prompts[number % 4]) == ""
        # Released, and pressed again.
        assert pressed.press(b" ", times[-1] + 750, Prompt.READY) == " "


def test_a_stuck_pedal_answers_nothing_between_other_keys(terminal):
    pressed = Pressed(terminal)
    with Cbreak(pressed.keys.descriptor):
        assert pressed.press(b" ", 0, Prompt.REVIEW) == " "
        for now_ms in range(33, 3000, 33):
            assert pressed.press(b" ", now_ms, Prompt.REVIEW) == ""
            if now_ms % 990 == 0:  # another key counts at once
                assert pressed.press(b"k", now_ms + 1, Prompt.REVIEW) == "k"


def test_letters_of_a_note_may_repeat(terminal):
    pressed = Pressed(terminal)
    with Cbreak(pressed.keys.descriptor):
        pressed.keys.line(asked(Prompt.NOTE))
        os.write(pressed.person, b"too wet\n")
        assert pressed.keys.line(asked(Prompt.NOTE)) == "too wet"


@pytest.mark.parametrize("prompt", [Prompt.MOVE, Prompt.LAY_DOWN])
def test_motion_of_the_arm_has_a_key_that_no_other_prompt_has(prompt):
    (key,) = [e.key for e in KEYS[prompt] if e.action is KeyAction.CONFIRM]
    others = set(KEYS) - {prompt}
    assert all(key != entry.key for other in others for entry in KEYS[other])


@pytest.mark.parametrize(
    ("typed", "answers"),
    [
        (b" ", [" "]),
        (b"\n", [" "]),
        (b"K", ["k"]),
        (b"r2", ["r2"]),
        (b"r9k", ["k"]),
        (b"rr1", ["r1"]),  # the second only repeats the first
        (b"rk1", ["1"]),  # any other key cancels the r
        (b"   ", [" "]),
        (b"\x1b[A", ["[", "a"]),
        (b"kq", ["k", "q"]),
        ("é".encode()[:1], []),
    ],
)
def test_keys_become_answers_one_at_a_time(terminal, typed, answers):
    person, keys = keys_of(terminal)
    with Cbreak(keys.descriptor):
        os.write(person, typed)
        received = [keys.answer(asked()) for _ in range(4)]
    assert [answer for answer in received if answer] == answers


def test_the_digit_of_a_reason_may_come_later(terminal):
    person, keys = keys_of(terminal)
    with Cbreak(keys.descriptor):
        os.write(person, b"r")
        assert keys.answer(asked()) == ""
        os.write(person, b"3")
        assert keys.answer(asked()) == "r3"


def test_r_is_a_plain_key_outside_the_review(terminal):
    person, keys = keys_of(terminal)
    with Cbreak(keys.descriptor):
        keys.answer(asked(Prompt.READY))
        os.write(person, b"r")
        assert keys.answer(asked(Prompt.READY)) == "r"


def test_keys_typed_before_a_prompt_do_not_answer_the_prompt(terminal):
    person, keys = keys_of(terminal)
    with Cbreak(keys.descriptor):
        os.write(person, b"kkk")
        assert keys.answer(asked(Prompt.READY)) == ""


def test_an_unplugged_keyboard_quits(terminal):
    person, keys = keys_of(terminal)
    os.close(person)
    assert keys.answer(asked()) == "q"


def test_only_terminal_input_changes_the_terminal_settings(terminal):
    _, program = terminal
    before = termios.tcgetattr(program)
    with keyboard(AutoOperator()):
        assert termios.tcgetattr(program) == before
    with keyboard(TerminalInput(program)):
        assert termios.tcgetattr(program) != before


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        (b"wet stones\n", "wet stones"),
        (b"Wet \xc3\xa9\r", "Wet é"),
        (b"wett\x7f stones\n", "wet stones"),
        (b"\x7f\x08wet\n", "wet"),
        (b"we\x1b[Dt\x1bOA\x1b[3~\n", "wet"),
        (b"wet\x1b", ""),
        (b"\n", ""),
        (b"wet\x01\x09\n", "wet"),
        (b"x" * (LONGEST_LINE + 9) + b"\n", "x" * LONGEST_LINE),
    ],
)
def test_a_line_ends_with_enter_and_is_abandoned_with_escape(terminal, typed, line):
    person, keys = keys_of(terminal)
    with Cbreak(keys.descriptor):
        assert keys.line(asked(Prompt.NOTE)) is None
        os.write(person, typed)
        assert keys.line(asked(Prompt.NOTE)) == line
        assert keys.draft == ""


def test_a_line_grows_while_it_is_typed(terminal):
    person, keys = keys_of(terminal)
    with Cbreak(keys.descriptor):
        keys.line(asked(Prompt.NOTE))
        for part, draft in ((b"we", "we"), ("é".encode()[:1], "we"), (b"\xa9", "weé")):
            os.write(person, part)
            assert keys.line(asked(Prompt.NOTE)) is None
            assert keys.draft == draft


def test_a_line_is_abandoned_when_the_keyboard_is_unplugged(terminal):
    person, keys = keys_of(terminal)
    keys.line(asked(Prompt.NOTE))
    os.close(person)
    assert keys.line(asked(Prompt.NOTE)) == ""


def test_keys_typed_after_a_line_do_not_answer_the_next_prompt(terminal):
    person, keys = keys_of(terminal)
    with Cbreak(keys.descriptor):
        keys.line(asked(Prompt.NOTE))
        os.write(person, b"k\nk")
        assert keys.line(asked(Prompt.NOTE)) == "k"
        assert keys.answer(asked(Prompt.REVIEW)) == ""
