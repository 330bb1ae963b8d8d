"""README's commands, one after the other as on a fresh machine, timed.

    python -m benchmarks.newcomer [--without "make test"]

Every command of README, its Python example last, runs in an empty folder with an empty
home, where only what the shell needs is set; the repository is cloned from here. A
command with a screen gets a terminal of 80 x 24, and the keys that it asks for. The
first that fails ends the run with its last words.
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

ADDRESS = "URL-OF-THIS-REPOSITORY"
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"\s{2,}#.*")
_KEPT = re.compile("PATH$|LANG$|PIP_|SSL_|HTTPS?_PROXY")  # where packages come from
_PIP = Path("~/.config/pip/pip.conf").expanduser()
_KEYS = (("[k]", "k"), ("[space]", " "))  # what a screen asks for, and what is pressed
_PATIENCE = 1.0  # s between two keys
_LAST = 2000  # characters of a screen that are looked at
_LIMIT_S = 1800.0


@dataclass(frozen=True, slots=True)
class Step:
    """One command and what it took.

    Attributes:
        text: as README has it.
        seconds: that it took.
        code: that it ended with.
        words: its last words.
    """

    text: str
    seconds: float
    code: int
    words: str


def commands_of(page: str) -> list[str]:
    """Return the commands of README's blocks without a language, in order."""
    lines = [
        line
        for language, block in _BLOCK.findall(page)
        if not language
        for line in block.splitlines()
    ]
    return [_COMMENT.sub("", line).strip() for line in lines if line.strip()]


def example_of(page: str) -> str:
    """Return README's Python example."""
    return next(block for language, block in _BLOCK.findall(page) if language)


class Newcomer:
    """Somebody with an empty home who types what README says."""

    def __init__(self, home: Path) -> None:
        self.folder = home
        kept = {name: text for name, text in os.environ.items() if _KEPT.match(name)}
        self._surroundings = {"PIP_CONFIG_FILE": str(_PIP)} if _PIP.exists() else {}
        self._surroundings |= kept | {"HOME": str(home), "TERM": "xterm-256color"}

    def type(self, text: str) -> Step:
        """Run one line in the shell; press the keys that its screen asks for."""
        line = text.replace(ADDRESS, str(ROOT))
        screen, program = pty.openpty()
        fcntl.ioctl(program, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        start = time.monotonic()
        process = subprocess.Popen(
            ["bash", "-c", f"{line}\npwd > '{self._folder_file}'"],
            cwd=self.folder,
            env=self._surroundings,
            stdin=program,
            stdout=program,
            stderr=program,
            start_new_session=True,
        )
        os.close(program)
        words = _sit_at(screen, process, start + _LIMIT_S)
        seconds = time.monotonic() - start
        code = process.wait()
        os.close(screen)
        if self._folder_file.exists():
            self.folder = Path(self._folder_file.read_text().strip())
        return Step(text, seconds, code, words)

    @property
    def _folder_file(self) -> Path:
        return Path(self._surroundings["HOME"]) / "place"


def _sit_at(screen: int, process: subprocess.Popen, end: float) -> str:
    """Press what is asked for until the program has ended; return its last words.

    A key that comes with its question may be forgotten: it is pressed again while the
    question is the last.
    """
    words, pressed = "", time.monotonic() - _PATIENCE
    while time.monotonic() < end:
        if select.select([screen], [], [], 0.2)[0]:
            try:
                words += os.read(screen, 65536).decode(errors="replace")
            except OSError:  # the other end is closed
                return words[-_LAST:]
        elif process.poll() is not None:
            return words[-_LAST:]
        key = _key_for(words[-_LAST:])
        if key and time.monotonic() - pressed >= _PATIENCE:
            os.write(screen, key.encode())
            pressed = time.monotonic()
    process.kill()
    return words[-_LAST:]


def _key_for(words: str) -> str:
    """Return the key that the last question on a screen asks for, empty for none."""
    for line in reversed(words.splitlines()):
        for question, key in _KEYS:
            if question in line:
                return key
    return ""


def print_step(step: Step) -> Step:
    """Print what a step took."""
    print(f"{step.seconds:7.1f} s  {step.text}", flush=True)
    return step


def walk(home: Path, without: list[str]) -> list[Step]:
    """Return the steps of a newcomer, up to the first that fails."""
    page = README.read_text()
    somebody = Newcomer(home)
    steps = list[Step]()
    for text in (x for x in commands_of(page) if x not in without):
        steps.append(print_step(somebody.type(text)))
        if steps[-1].code:
            return steps
    (somebody.folder / "example.py").write_text(example_of(page))
    steps.append(print_step(somebody.type(".venv/bin/python example.py")))
    return steps


def main() -> int:
    """Run the commands, print what they took; return 1 where one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--without", action="append", default=[], metavar="COMMAND")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        steps = walk(Path(home), given.without)
    if steps[-1].code:
        print(steps[-1].words)
        return 1
    print(f"{sum(step.seconds for step in steps):7.1f} s  all. {surroundings()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
