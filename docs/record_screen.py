"""Records the operator's screen and draws it as an SVG that moves.

.venv/bin/python docs/record_screen.py docs/screen.svg

A simulated trial in a terminal of 80 by 24, keys pressed at set times. The simulation
runs on stepped time, so any computer will do; pictures of the trial are shown at its
own time. `make docs` installs what it needs.
"""

import codecs
import fcntl
import json
import os
import pty
import re
import select
import struct
import subprocess
import sys
import tempfile
import termios
from collections.abc import Iterator
from pathlib import Path

from acquisition.clock import NS_PER_S, SystemClock

_CLOCK = SystemClock()
COLUMNS, ROWS = 80, 24
_LONGEST = 90.0  # s
_APART = 0.25  # s between two pictures
_STILL = 1.5  # s that a picture stands at most
# What the screen says, and the key that is pressed then, after so long [s].
_KEYS = (
    ("then [space]", 0.5, " "),
    ("[space] record", 2.0, " "),
    ("[k]eep", 4.0, "k"),
)
_TRIAL = re.compile(r"● REC T01  (\d+\.\d) s")


def main() -> int:
    """Record, draw into the file that is named, return the exit code."""
    program = [sys.executable, "-m", "experiments"]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        command = [*program, "run", "S0", "--fake", "--fast", "--trials", "1"]
        cast = folder / "screen.cast"
        head = {"version": 2, "width": COLUMNS, "height": ROWS}
        events = _thinned(list(_watched(command, folder)))
        lines = [json.dumps(head), *(json.dumps(event) for event in events)]
        cast.write_text("\n".join(lines) + "\n", encoding="utf-8")
        draw = [sys.executable, "-m", "termtosvg", "render", str(cast), sys.argv[1]]
        return subprocess.run([*draw, "-t", "window_frame"], check=False).returncode


def _watched(command: list[str], folder: Path) -> Iterator[tuple[float, str, str]]:
    """Yield (time [s], "o", text) of what a program writes to its terminal."""
    child, terminal = pty.fork()
    if child == 0:
        os.environ["TERM"] = "xterm-256color"
        os.chdir(folder)
        os.execv(command[0], command)
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("4H", ROWS, COLUMNS, 0, 0))
    decode = codecs.getincrementaldecoder("utf-8")("replace").decode
    begin, unread, keys, due = _CLOCK.now_ns(), "", list(_KEYS), float("inf")
    while (now := (_CLOCK.now_ns() - begin) / NS_PER_S) < _LONGEST:
        if now >= due:
            os.write(terminal, keys.pop(0)[2].encode())
            unread, due = "", float("inf")
        if not select.select([terminal], [], [], 0.05)[0]:
            continue
        try:
            text = decode(os.read(terminal, 65536))
        except OSError:  # the program has ended
            break
        unread += text
        if keys and keys[0][0] in unread and due == float("inf"):
            due = now + keys[0][1]
        yield now, "o", text
    os.close(terminal)
    os.waitpid(child, 0)


def _thinned(
    events: list[tuple[float, str, str]],
) -> list[tuple[float, str, str]]:
    """Return the events in pictures that are not too near, nor stand too long."""
    shown: list[tuple[float, str, str]] = []
    clock = last = trial = 0.0
    for at, kind, text in events:
        step = min(at - last, _STILL)
        if times := _TRIAL.findall(text):
            now = float(times[-1])
            step, trial = max(now - trial, 0.0), now
        clock, last = clock + step, at
        if shown and clock - shown[-1][0] < _APART:
            shown[-1] = (shown[-1][0], kind, shown[-1][2] + text)
            continue
        shown.append((round(clock, 3), kind, text))
    return shown


if __name__ == "__main__":
    sys.exit(main())
