"""Speed of a stepped simulation relative to real time, and its breakdown by part.

    python -m benchmarks.lockstep [--seconds 20] [--rounds 3] [--json]

Loop, drivers, recorder and simulated devices are those of a session, all in one thread.
The total is the processor time of runs without instrumentation; the breakdown comes
from instrumented runs.
"""

import argparse
import gc
import hashlib
import json
import statistics
import tempfile
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any, ParamSpec, TypeVar
from unittest.mock import patch

from acquisition.control_loop.states import ArmState
from acquisition.recording.recorder import Recorder
from acquisition.trial_file.writer import TrialHeader
from benchmarks.rows import BenchRow
from experiments.rig.requests import OpenSensor, StartArm
from experiments.rig.rig import FakeOptions, Rig, build_rig
from experiments.settings.load import load_settings
from fakes.bus.in_process import FakeCanBus, InProcessTransport
from fakes.plant.plant import ArmPlant
from fakes.sensor.port import FakeSerialPort
from ft_sensor.payload import LiveFoot
from ft_sensor.serial_line.sensor import SerialSensor
from wam.control.controller import FootController
from wam.driver.arm import WamArm

GOAL = 8.0  # times real time, with recorder
TERRAIN = "S0"
LOOP = "loop, guard, sample"
P = ParamSpec("P")
R = TypeVar("R")
PARTS = {
    "plant": ((ArmPlant, "advance"),),
    "bus and pucks": (
        (FakeCanBus, "advance"),
        (InProcessTransport, "send"),
        (InProcessTransport, "receive"),
    ),
    "arm driver": ((WamArm, "read"), (WamArm, "send")),
    "sensor simulation": ((FakeSerialPort, "advance"),),
    "sensor driver": ((SerialSensor, "poll"),),
    "law and foot": ((FootController, "torque"), (LiveFoot, "observe")),
    "recorder": ((Recorder, "drain"),),
}
HEADER = TrialHeader(
    trial={"session": "bench"},
    utc_offset_ns=0,
    offset_uncertainty_ns=0,
    provenance={},
    attachments={},
    robot_description="",
)


def float_rig() -> Rig:
    """Return a simulated rig whose operator pushes the foot over stones."""
    settings = load_settings(None)
    rig = build_rig(settings, settings.row(TERRAIN), FakeOptions("fast", seed=1))
    backend, hand = rig.backend, rig.simulation
    assert hand is not None
    backend.ask(StartArm())
    backend.ask(OpenSensor())
    backend.begin()
    backend.loop_client.start()
    backend.loop_client.advance(0.1)
    hand.lift()
    hand.pendant("activate")
    backend.loop_client.advance(1.5)
    backend.loop_client.request(ArmState.FLOAT)
    hand.prepare(1)
    hand.put_down()
    backend.loop_client.advance(2.0)
    hand.push()
    return rig


def without_collector() -> None:
    """Collect garbage, then disable the collector as the control process does."""
    gc.enable()
    gc.collect()
    gc.freeze()
    gc.disable()


def timed(
    rig: Rig, seconds: float, parts: "PartClock | None" = None
) -> tuple[float, str]:
    """Simulate with the recorder on; return (CPU time [s], digest of the samples).

    Args:
        rig: simulated rig; closed at the end.
        seconds: simulated time.
        parts: instruments the calls, if given.
    """
    digest = hashlib.sha256()
    without_collector()
    reader = rig.shared.cycles.reader()
    rig.backend.loop_client.on_tick.append(
        lambda: digest.update(reader.read().tobytes())
    )
    with tempfile.TemporaryDirectory() as folder:
        rig.backend.recorder.start(Path(folder) / "bench.mcap", HEADER)
        with nullcontext() if parts is None else parts.watching():
            start = time.process_time()
            rig.backend.loop_client.advance(seconds)
            cpu_s = time.process_time() - start
        rig.backend.recorder.finish("bench")
    rig.backend.close()
    return cpu_s, digest.hexdigest()


class PartClock:
    """Measures how the time of a simulation divides among its parts.

    A watched call stops the clock of the part that it interrupts, so the parts sum to
    the whole. Wall time is used: reading processor time takes ten times as long, and
    other load on the machine delays all parts alike.

    Attributes:
        spent_ns: time by part; time outside watched calls belongs to the loop.
    """

    def __init__(self, now_ns: Callable[[], int] = time.perf_counter_ns) -> None:
        self.spent_ns = dict.fromkeys((*PARTS, LOOP), 0)
        self._now_ns = now_ns
        self._part, self._since_ns = LOOP, now_ns()

    def shares(self) -> dict[str, float]:
        """Return the share of time of every part."""
        self._enter(LOOP)
        whole_ns = sum(self.spent_ns.values())
        return {part: ns / whole_ns for part, ns in self.spent_ns.items()}

    @contextmanager
    def watching(self) -> Generator[None]:
        """Instrument the calls of `PARTS` inside the with block."""
        with ExitStack() as stack:
            for part, calls in PARTS.items():
                for owner, name in calls:
                    watched = self._watched(part, getattr(owner, name))
                    stack.enter_context(patch.object(owner, name, watched))
            self._since_ns = self._now_ns()
            yield

    def _watched(self, part: str, call: Callable[P, R]) -> Callable[P, R]:
        def watched(*args: P.args, **kwargs: P.kwargs) -> R:
            before = self._enter(part)
            try:
                return call(*args, **kwargs)
            finally:
                self._enter(before)

        return watched

    def _enter(self, part: str) -> str:
        """Start the clock of `part`; return the part whose clock stopped."""
        now_ns, before = self._now_ns(), self._part
        self.spent_ns[before] += now_ns - self._since_ns
        self._part, self._since_ns = part, now_ns
        return before


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    cpu_s = [timed(float_rig(), 8.0)[0] for _ in range(2)]
    pace = 8.0 / min(cpu_s)
    what = "stepped simulation with recorder, against real time"
    return [BenchRow(what, pace, "times", GOAL, is_lower_bound=True)]


def measured(seconds: float, rounds: int) -> dict[str, Any]:
    """Return medians of `rounds` pairs of runs, without and with instrumentation."""
    whole: list[float] = []
    shares: list[dict[str, float]] = []
    digests: set[str] = set()
    for _ in range(rounds):
        cpu_s, digest = timed(float_rig(), seconds)
        whole.append(cpu_s)
        parts = PartClock()
        digests |= {digest, timed(float_rig(), seconds, parts)[1]}
        shares.append(parts.shares())
    us = statistics.median(whole) / (seconds * 500) * 1e6
    medians = {
        part: statistics.median(row[part] for row in shares) for part in shares[0]
    }
    total = sum(medians.values())
    return {
        "terrain": TERRAIN,
        "times_real_time": seconds / statistics.median(whole),
        "goal": GOAL,
        "us_per_cycle": us,
        "us_of_parts": {part: us * share / total for part, share in medians.items()},
        "runs": 2 * rounds,
        "are_bit_identical": len(digests) == 1,
    }


def main() -> None:
    """Measure and print medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    report = measured(args.seconds, args.rounds)
    if args.json:
        print(json.dumps(report, indent=2))
        return
    print(
        f"{args.seconds:g} s on {TERRAIN}, stepped, one thread, with recorder: "
        f"{report['times_real_time']:.1f} times real time (goal {GOAL:g})"
    )
    for name, value in {"all": report["us_per_cycle"], **report["us_of_parts"]}.items():
        print(f"{name:28}{value:8.1f} us per cycle of 2 ms")
    same = "bit-identical" if report["are_bit_identical"] else "DIFFERENT"
    print(f"{report['runs']} runs: {same}")


if __name__ == "__main__":
    main()
