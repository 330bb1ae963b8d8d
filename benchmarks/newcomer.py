"""Run and time README's commands in order, as on a fresh machine.

    python -m benchmarks.newcomer [--without "make test"]

The repository is cloned from this one into an empty home folder, and README's commands
run there with a minimal environment, in a terminal of 80 x 24, and get the keys that
their screens ask for. The first failure ends the run and its last output is printed.
"""

import argparse
import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import tempfile
import termios
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.readme import README, ROOT
from benchmarks.surroundings import surroundings

_CLONE = f"git clone {ROOT} traction && cd traction"
_BLOCK = re.compile(r"^```\n(.*?)^```", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"\s{2,}#.*")
# Environment variables passed on: path, language and the source of packages.
_PASSED_ON = re.compile("PATH$|LANG$|PIP_|SSL_|HTTPS?_PROXY")
_PIP = Path("~/.config/pip/pip.conf").expanduser()
_KEYS = (("[k]", "k"), ("[i]dle", "i"), ("[space]", " "))  # prompt on screen, key
_KEY_INTERVAL = 1.0  # s
_TAIL = 2000  # characters of output that are searched
_LIMIT_S = 1800.0


@dataclass(frozen=True, slots=True)
class Step:
    """One command and its result.

    Attributes:
        text: the command as in README.
        seconds: its duration [s].
        code: its exit code.
        words: the end of its output.
    """

    text: str
    seconds: float
    code: int
    words: str


def commands_of(page: str) -> list[str]:
    """Return the commands of README's code blocks, in order."""
    lines = [line for block in _BLOCK.findall(page) for line in block.splitlines()]
    return [_COMMENT.sub("", line).strip() for line in lines if line.strip()]


class Newcomer:
    """A shell user with an empty home folder who types README's commands."""

    def __init__(self, home: Path) -> None:
        self.folder = home
        kept = {name: v for name, v in os.environ.items() if _PASSED_ON.match(name)}
        self._environment = {"PIP_CONFIG_FILE": str(_PIP)} if _PIP.exists() else {}
        self._environment |= kept | {"HOME": str(home), "TERM": "xterm-256color"}

    def type(self, text: str) -> Step:
        """Run one line in the shell and press the keys that its screen asks for."""
        screen, program = pty.openpty()
        fcntl.ioctl(program, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        start = time.monotonic()
        process = subprocess.Popen(
            ["bash", "-c", f"{text}\npwd > '{self._folder_file}'"],
            cwd=self.folder,
            env=self._environment,
            stdin=program,
            stdout=program,
            stderr=program,
            start_new_session=True,
        )
        os.close(program)
        words = _press_keys(screen, process, start + _LIMIT_S)
        seconds = time.monotonic() - start
        code = process.wait()
        os.close(screen)
        if self._folder_file.exists():
            self.folder = Path(self._folder_file.read_text().strip())
        return Step(text, seconds, code, words)

    @property
    def _folder_file(self) -> Path:
        return Path(self._environment["HOME"]) / "place"


def _press_keys(screen: int, process: subprocess.Popen, end: float) -> str:
    """Press the requested keys until the program ends; return the end of its output.

    A key pressed while its prompt is still being drawn may be lost, so it is pressed
    again while the prompt is the last one.
    """
    words, pressed = "", time.monotonic() - _KEY_INTERVAL
    while time.monotonic() < end:
        if select.select([screen], [], [], 0.2)[0]:
            try:
                words += os.read(screen, 65536).decode(errors="replace")
            except OSError:  # the other end is closed
                return words[-_TAIL:]
        elif process.poll() is not None:
            return words[-_TAIL:]
        key = _key_for(words[-_TAIL:])
        if key and time.monotonic() - pressed >= _KEY_INTERVAL:
            os.write(screen, key.encode())
            pressed = time.monotonic()
    process.kill()
    return words[-_TAIL:]


def _key_for(words: str) -> str:
    """Return the key for the last prompt on a screen, "" for none."""
    for line in reversed(words.splitlines()):
        for question, key in _KEYS:
            if question in line:
                return key
    return ""


def print_step(step: Step) -> Step:
    """Print the duration of a step; return the step."""
    print(f"{step.seconds:7.1f} s  {step.text}", flush=True)
    return step


def walk(home: Path, without: list[str]) -> list[Step]:
    """Run README's commands up to the first failure; return the steps."""
    user = Newcomer(home)
    steps = list[Step]()
    for text in (_CLONE, *commands_of(README.read_text())):
        if text in without:
            continue
        steps.append(print_step(user.type(text)))
        if steps[-1].code:
            break
    return steps


def main() -> int:
    """Run the commands and print their durations; return 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--without", action="append", default=[], metavar="COMMAND")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        steps = walk(Path(home), args.without)
    if steps[-1].code:
        print(steps[-1].words)
        return 1
    print(f"{sum(step.seconds for step in steps):7.1f} s  all. {surroundings()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
