"""A terminal is restored, however a session on it ends."""

import contextlib
import fcntl
import os
import pty
import select
import signal
import subprocess
import sys
import termios

import pytest

from tests.processes.watching import is_stalled, judged, patient_config

pytestmark = [pytest.mark.wall_clock, pytest.mark.timeout(200)]
PATIENCE, LOOK = 20.0, 0.3  # s without output, in total and per look
PRESS_EVERY = 4  # looks: more often a key would seem to be held
TRIES = 5


class Person:
    """A person at a pseudo-terminal, and the program on it."""

    def __init__(self, *arguments):
        self.screen, self._program = pty.openpty()
        self.before = self.settings()
        self.text = self.shown = ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "experiments", *map(str, arguments)],
            stdin=self._program,
            stdout=self._program,
            stderr=self._program,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # noqa: PLW1509
            env={**os.environ, "TERM": "xterm"},
        )

    def settings(self):
        """Settings of the terminal, as `stty` shows them."""
        return termios.tcgetattr(self.screen)

    def type(self, keys):
        os.write(self.screen, keys.encode())

    def read(self):
        text = os.read(self.screen, 4096).decode(errors="ignore")
        self.text += text
        self.shown += text

    def see(self, words, *, typing=""):
        """Read until `words` appear on the screen; type `typing` until then.

        A key that arrives together with its prompt may be dropped as an earlier one.
        """
        looks = 0
        while words not in self.text:
            if select.select([self.screen], [], [], LOOK)[0]:
                self.read()
                continue
            looks += 1
            assert looks < PATIENCE / LOOK, f"no {words!r}: {self.text[-500:]}"
            if looks % PRESS_EVERY == 1:
                self.type(typing)
        self.text = self.text.partition(words)[2]

    def end(self):
        """Read on until the program has ended; its exit code."""
        while self.process.poll() is None:
            if select.select([self.screen], [], [], 0.05)[0]:
                self.read()
        return self.process.returncode

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        for descriptor in (self.screen, self._program):
            with contextlib.suppress(OSError):
                os.close(descriptor)


@contextlib.contextmanager
def person_at(folder):
    """A person at a session whose files are in `folder`."""
    folder.mkdir()
    options = ("--fake", "--processes", "--trials", 1)
    options += ("--config", patient_config(folder))
    person = Person("run", "TF", *options, "--data", folder / "data")
    try:
        yield person
    finally:
        person.close()


def once(person):
    person.type("\x03")


def twice(person):
    person.type("\x03\x03")


def terminated(person):
    os.kill(person.process.pid, signal.SIGTERM)


def hung_up(person):
    os.kill(person.process.pid, signal.SIGHUP)


@pytest.mark.parametrize("leave", [once, twice, terminated, hung_up])
def test_the_terminal_is_restored_after_a_session(tmp_path, leave):
    assert judged(tmp_path, lambda folder: is_restored(folder, leave), TRIES)


def is_restored(folder, leave):
    """Leave one session; None if a stall of the machine had ended the session."""
    with person_at(folder) as person:
        try:
            leave_in_trial(person, leave)
        except AssertionError:
            if is_stalled(person.shown) and person.settings() == person.before:
                return None
            raise
    return True


def leave_in_trial(person, leave):
    person.see("then [space].")
    assert not person.settings()[3] & (termios.ICANON | termios.ECHO)
    person.see("Lift the foot clear of everything", typing=" ")
    leave(person)
    person.see("[i]dle")
    person.see("ARM: idle; it sinks slowly, support it.", typing="i")
    assert person.end() == 5
    assert person.settings() == person.before
