"""Paced simulated sessions on a busy machine, and their processor use while waiting.

python -m benchmarks.paced [--trials 10] [--busy 4] [--waiting 60] [--terrain TF]

Runs a paced session alongside N busy processes per core, and the same session with
--fast: the trials must be equal byte for byte. Prints the exit codes, the simulated
over the wall time, and the share of a core that a session uses at its unanswered first
prompt, paced and with --fast. With --busy 0 the machine must be idle.
"""

import argparse
import hashlib
import json
import os
import pty
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path

from acquisition.cores import available_cores

BUSY = "while True: pass"
PROGRAM = (sys.executable, "-m", "experiments")


def session(data: Path, terrain: str, trials: int, *more: str) -> tuple[int, float]:
    """Run a session; return its exit code and the ratio of simulated to wall time."""
    command = ("run", terrain, "--fake", "--operator-script", "auto", *more)
    options = ("--trials", str(trials), "--data", str(data))
    process = subprocess.Popen(
        (*PROGRAM, *command, *options),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    began = 0.0
    while process.poll() is None:
        if not began and list(data.glob("sessions/*/events.jsonl")):
            began = time.time()
        time.sleep(0.02)
    (journal,) = data.glob("sessions/*/events.jsonl")
    lines = [json.loads(line) for line in journal.read_text().splitlines()]
    first, last = (datetime.fromisoformat(lines[k]["utc"]) for k in (0, -1))
    wall = journal.stat().st_mtime - began
    return process.returncode, (last - first).total_seconds() / wall


def digests(data: Path) -> list[str]:
    """Return the checksums of the trials of the session below `data`."""
    paths = sorted(data.glob("sessions/*/trials/T*.mcap"))
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]


def share_while_waiting(data: Path, seconds: float, *more: str) -> float:
    """Return the share of a core that a session uses at its first prompt."""
    main, child = pty.openpty()
    command = ("run", "TF", "--fake", "--trials", "1", "--data", str(data), *more)
    process = subprocess.Popen(
        (*PROGRAM, *command), stdin=child, stdout=child, stderr=child
    )
    try:
        output = b""
        while b"[space]" not in output:
            output += os.read(main, 4096)
        time.sleep(2.0)
        before = _cpu_time(process.pid)
        time.sleep(seconds)
        return (_cpu_time(process.pid) - before) / seconds
    finally:
        process.kill()
        process.wait()
        os.close(main)
        os.close(child)


def _cpu_time(pid: int) -> float:
    """Return the processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> int:
    """Measure and print; return 1 if a trial differs or waiting costs too much."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--busy", type=int, default=4, help="processes per core (4)")
    parser.add_argument("--waiting", type=float, default=60.0, help="seconds (60)")
    parser.add_argument("--terrain", default="TF")
    args = parser.parse_args()
    failed = False
    with ExitStack() as stack:
        folders = [
            Path(stack.enter_context(tempfile.TemporaryDirectory())) for _ in range(4)
        ]
        busy = [
            subprocess.Popen((sys.executable, "-c", BUSY))
            for _ in range(args.busy * available_cores())
        ]
        try:
            code, share = session(folders[0], args.terrain, args.trials)
        finally:
            for process in busy:
                process.kill()
                process.wait()
        fast, speed = session(folders[1], args.terrain, args.trials, "--fast")
        is_equal = digests(folders[0]) == digests(folders[1]) != []
        print(
            f"paced, {len(busy)} busy processes: exit {code}, {share:.2f} x real "
            f"time, {args.trials} trials; --fast: exit {fast}, {speed:.2f} x; trials "
            f"{'equal byte for byte' if is_equal else 'DIFFER'}"
        )
        failed = bool(code or fast) or not is_equal
        for folder, more in zip(folders[2:], ((), ("--fast",)), strict=True):
            if args.waiting:
                used = share_while_waiting(folder, args.waiting, *more)
                how = " ".join(("--fake", *more))
                print(f"waiting for a key, {how}: {100.0 * used:.1f} % of a core")
                failed = failed or used >= 0.1
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
