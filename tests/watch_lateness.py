"""How late the loop's cycles are with and without a second screen, side by side.

    python -m tests.watch_lateness [--windows 8] [--seconds 20]

One simulated session on the wall clock. `traction watch` and a client that reads every
channel run in every other window; the first seconds of each, in which programs start
and end, are left out. Printed are the median of the windows' medians and 99 %
quantiles, and beside each window how often a program that only sleeps was held up.
"""

import argparse
import sys
import tempfile
import threading
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import numpy as np

from lab.guest.viewer import Viewer
from tests.processes.test_second_screen import end, watching
from tests.processes.watching import CLOCK, session, wait
from tests.stalls import stall_witness

SETTLING = 5.0  # s of a window
LOOK = 0.5  # s between two looks at the ring
TRIALS = 99  # more than are recorded meanwhile


@contextmanager
def second_screen(data):
    """Serve a session, and read all of what is served; yield what was read by topic."""
    server, port = watching(data)
    stop = threading.Event()
    with Viewer(port) as viewer:
        viewer.look(lambda v: v.channels)

        def follow():
            with suppress(OSError):
                viewer.look(lambda v: stop.is_set())

        follower = threading.Thread(target=follow)
        follower.start()
        try:
            yield viewer.messages
        finally:
            stop.set()
            follower.join(5.0)
            end(server)


def lateness(shared, seconds):
    """Return how late every cycle of so many seconds began [us]."""
    reader, rows = shared.timings.reader(), []
    for _ in range(round(seconds / LOOK)):
        wait(LOOK)
        rows.append(reader.read())
    cycles = np.concatenate(rows)
    return (cycles["woke_ns"].astype(np.int64) - cycles["deadline_ns"]) * 1e-3


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--windows", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=20.0)
    given = parser.parse_args()
    found = {False: [], True: []}
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data"
        with (
            stall_witness(Path(folder)) as witness,
            session(data, "--trials", str(TRIALS)) as seen,
        ):
            if not seen.wait_for_trial():
                sys.exit(f"This machine runs no session at 500 Hz.\n{seen.output()}")
            for number in range(given.windows):
                is_on = number % 2 == 1
                with second_screen(data) if is_on else nullcontext({}) as read:
                    wait(SETTLING)
                    start_ns = CLOCK.now_ns()
                    late = lateness(seen.shared, given.seconds)
                    stalls = witness.stalls_since(start_ns)
                found[is_on].append(np.quantile(late, [0.5, 0.99]))
                low, high = found[is_on][-1]
                name = "watched" if is_on else "alone"
                print(  # noqa: T201
                    f"{name}: {late.size} cycles, p50 {low:.1f} us, p99 {high:.1f} us, "
                    f"{stalls} stalls, {sum(map(len, read.values()))} messages read",
                    flush=True,
                )
    for index, name in enumerate(("p50", "p99")):
        alone, watched = (
            float(np.median([row[index] for row in found[key]])) for key in found
        )
        told = f"{name}: {alone:.1f} us alone, {watched:.1f} us watched"
        print(told)  # noqa: T201


if __name__ == "__main__":
    main()
