"""How much faster than the clock a stepped simulation runs, and where the time goes.

    python benchmarks/lockstep.py [--seconds 20] [--rounds 3] [--json]

The loop, the drivers, the recorder and the simulated devices are the ones of a session;
everything runs in one thread. The recorder's part is the difference to the same cycles
without it; the plant's is measured around its calls, in runs of their own.
"""

import argparse
import gc
import hashlib
import json
import statistics
import tempfile
import time
from pathlib import Path

from acquisition.control_loop.states import ArmState
from acquisition.trial_file.writer import TrialHeader
from benchmarks.rows import BenchRow
from experiments.rig.rig import FakeOptions, Rig, build_rig
from experiments.settings.load import load_settings
from fakes.clock import SteppedClock
from fakes.world.rig import FakeRig

GOAL = 6.0  # times real time, with recorder
TERRAIN = "S0"
HEADER = TrialHeader(
    trial={"session": "bench"},
    utc_offset_ns=0,
    offset_uncertainty_ns=0,
    provenance={},
    attachments={},
    robot_description="",
)


def float_rig() -> Rig:
    """Return a simulated rig whose hand pushes the foot over stones."""
    settings = load_settings(None)
    rig = build_rig(settings, settings.row(TERRAIN), FakeOptions(is_fast=True, seed=1))
    backend, hand = rig.backend, rig.simulation
    assert hand is not None
    backend.start_arm()
    backend.open_sensor()
    backend.begin()
    backend.loop_client.request(ArmState.HOLD)
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
    """Tidy up and keep the garbage collector out, as the control process does."""
    gc.enable()
    gc.collect()
    gc.freeze()
    gc.disable()


def timed(rig: Rig, seconds: float, *, is_recording: bool) -> tuple[float, str]:
    """Return (CPU seconds of `seconds` of simulation, digest of its samples)."""
    digest = hashlib.sha256()
    without_collector()
    reader = rig.shared.cycles.reader()
    rig.backend.loop_client.on_tick.append(
        lambda: digest.update(reader.read().tobytes())
    )
    with tempfile.TemporaryDirectory() as folder:
        if is_recording:
            rig.backend.recorder.start(Path(folder) / "bench.mcap", HEADER)
        start = time.process_time()
        rig.backend.loop_client.advance(seconds)
        spent = time.process_time() - start
        if is_recording:
            rig.backend.recorder.finish("bench")
    rig.backend.close()
    return spent, digest.hexdigest()


def plant_share(seconds: float) -> float:
    """Return the CPU seconds that the plant takes of `seconds` of simulation."""
    rig = float_rig()
    without_collector()
    clock = rig.clock
    assert isinstance(clock, SteppedClock)
    world = clock.world
    assert isinstance(world, FakeRig)
    advance = world.plant.advance
    spent_ns = 0

    def watched(t_ns: int) -> None:
        nonlocal spent_ns
        start_ns = time.process_time_ns()
        advance(t_ns)
        spent_ns += time.process_time_ns() - start_ns

    world.plant.advance = watched
    rig.backend.loop_client.advance(seconds)
    rig.backend.close()
    return spent_ns * 1e-9


def rows() -> list[BenchRow]:
    """Return what was measured, for the table."""
    spent = [timed(float_rig(), 8.0, is_recording=True)[0] for _ in range(2)]
    pace = 8.0 / min(spent)
    what = "stepped simulation with recorder, against real time"
    return [BenchRow(what, pace, "times", 15.0, is_least=True)]


def main() -> None:
    """Measure, alternating, and print medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    whole, bare, plant = [], [], []
    digests = set()
    for _ in range(args.rounds):
        spent, digest = timed(float_rig(), args.seconds, is_recording=True)
        whole.append(spent)
        digests.add(digest)
        spent, digest = timed(float_rig(), args.seconds, is_recording=False)
        bare.append(spent)
        digests.add(digest)
        plant.append(plant_share(args.seconds))
    cycles = args.seconds * 500
    us = {
        name: statistics.median(values) / cycles * 1e6
        for name, values in (("whole", whole), ("bare", bare), ("plant", plant))
    }
    report = {
        "terrain": TERRAIN,
        "times_real_time": args.seconds / statistics.median(whole),
        "goal": GOAL,
        "us_per_cycle": {
            "all": us["whole"],
            "recorder": us["whole"] - us["bare"],
            "plant": us["plant"],
            "bus, sensor, drivers, loop": us["bare"] - us["plant"],
        },
        "runs": 2 * args.rounds,
        "are_bit_identical": len(digests) == 1,
    }
    if args.json:
        print(json.dumps(report, indent=2))
        return
    print(
        f"{args.seconds:g} s on {TERRAIN}, stepped, one thread, with recorder: "
        f"{report['times_real_time']:.1f} times real time (goal {GOAL:g})"
    )
    for name, value in report["us_per_cycle"].items():
        print(f"{name:28}{value:8.1f} us per cycle of 2 ms")
    same = "bit-identical" if report["are_bit_identical"] else "DIFFERENT"
    print(f"{report['runs']} runs: {same}")


if __name__ == "__main__":
    main()
