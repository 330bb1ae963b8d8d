"""Screens of a simulated session as an operator sees them, to be looked at.

.venv/bin/python docs/terminal_screens.py FOLDER

Needs tmux. Writes the text of the start, a running trial, the review, a fault and the
pause after it at 80 by 24 and 60 by 20, and names every line that does not fit.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from acquisition.clock import NS_PER_S, SystemClock

SIZES = ((80, 24), (60, 20))
FAULT = ("--fault", "ft-stale@T2+2s")
# What the screen says, what the picture of it is called, the keys pressed then.
STEPS = (
    (r"then\s+\[space\]", "start", " "),
    (r"\[space\] record", "ready", " "),
    ("● REC T01  0[5-9]", "recording", ""),
    (r"\[k\]eep", "review", "k"),
    (r"\[space\] record", "kept", " "),
    (r"F/T\s+sample [0-9]", "fault", ""),
    (r"\[space\] record  ", "again", "q"),
)
_PATIENCE = 90.0  # s
_CLOCK = SystemClock()


def tmux(*words: str) -> str:
    """Run a command of tmux on a server of its own and return what it prints."""
    command = ["tmux", "-L", "traction-screens", *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def awaited(pattern: str) -> bool:
    """Wait until the screen says `pattern`; return whether it did."""
    end = _CLOCK.now_ns() + int(_PATIENCE * NS_PER_S)
    while _CLOCK.now_ns() < end:
        if re.search(pattern, tmux("capture-pane", "-p")):
            return True
        _CLOCK.sleep_until(_CLOCK.now_ns() + NS_PER_S // 20)
    return False


def take(columns: int, rows: int, data: Path, folder: Path) -> bool:
    """Write every screen at one size; return whether all fit."""
    program = [sys.executable, "-m", "experiments"]
    run = [*program, "run", "S0", "--fake", "--fast", "--trials", "2"]
    run += [*FAULT, "--data", str(data)]
    size = ["-x", str(columns), "-y", str(rows)]
    tmux("new-session", "-d", *size, " ".join([*run, "; sleep 600"]))
    is_fine = True
    for pattern, name, keys in STEPS:
        if not awaited(pattern):
            print(f"{columns}x{rows} {name}: no {pattern!r}")  # noqa: T201
            is_fine = False
            break
        picture = folder / f"{columns}x{rows}-{name}.txt"
        picture.write_text(tmux("capture-pane", "-p"), encoding="utf-8")
        joined = tmux("capture-pane", "-p", "-J").splitlines()
        for line in joined:
            if len(line.rstrip()) > columns:
                print(f"{picture.name}: wraps: {line.rstrip()}")  # noqa: T201
                is_fine = False
        if keys:
            tmux("send-keys", "-l", keys)
    tmux("send-keys", "C-c", "C-c")
    awaited("To go on:|traction resume")
    tmux("kill-server")
    return is_fine


def main() -> int:
    """Take the screens at both sizes; return the exit code."""
    if shutil.which("tmux") is None:
        sys.exit("tmux was not found.")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    is_fine = True
    for columns, rows in SIZES:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as data:
            is_fine = take(columns, rows, Path(data), folder) and is_fine
    return 0 if is_fine else 1


if __name__ == "__main__":
    sys.exit(main())
