"""The recorder under load: losses, backlog, processor time and memory of its process.

    python -m benchmarks.recorder [--seconds 60] [--rate 500] [--json]

A paced writer fills the shared memory in place of the loop, `--rate` cycles per second
with two force samples and thirteen frames each; bit patterns vary so that the data do
not compress unrealistically well.
"""

import argparse
import json
import os
import tempfile
from pathlib import Path

import numpy as np

from acquisition.clock import NS_PER_S, PERIOD_NS, SystemClock
from acquisition.devices import WrenchSample
from acquisition.ipc.child import Child
from acquisition.ipc.frame_ring import FrameRing
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.shared_sensor import pack_wrench
from acquisition.recording.recorder_process import RemoteRecorder
from acquisition.sample import Sample
from acquisition.schema import CYCLE
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.writer import TrialHeader
from benchmarks.rows import BenchRow

MAIN = "acquisition.recording.recorder_process:main"
BURST_NS = 10_000_000
PAGE_KB = os.sysconf("SC_PAGE_SIZE") / 1024
_WRENCH = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
HEADER = TrialHeader(
    trial={"session": "bench"},
    utc_offset_ns=0,
    offset_uncertainty_ns=0,
    provenance={},
    attachments={},
    robot_description="",
    has_frames=True,
)


class Load:
    """Writes the data of a control loop, cycle by cycle."""

    def __init__(self, shared: SharedLayout) -> None:
        self._shared = shared
        self._sample = Sample()
        self._tape = FrameRing(shared.frames, SystemClock())
        self._noise = np.random.default_rng(1).normal(size=(997, 7))
        self.cycles = 0

    def cycle(self, now_ns: int) -> None:
        """Write one cycle with the monotonic time `now_ns`."""
        sample, number = self._sample, self.cycles
        sample.cycle[0] = number
        sample.host_ns[0] = now_ns
        sample.position[:] = self._noise[number % 997]
        sample.velocity[:] = self._noise[number % 991]
        self._shared.cycles.write(sample.payload())
        for _ in range(2):
            wrench = WrenchSample(now_ns, number, _WRENCH, 0, True, False)
            self._shared.wrenches.write(pack_wrench(wrench))
        data = number.to_bytes(8, "little")
        self._tape.add([(0x400 + frame, data, now_ns) for frame in range(13)])
        self.cycles += 1


def usage(pid: int) -> tuple[float, float]:
    """Return (CPU seconds, resident memory [KiB]) of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    ticks = os.sysconf("SC_CLK_TCK")
    return (int(fields[11]) + int(fields[12])) / ticks, int(fields[21]) * PAGE_KB


def run(seconds: float, rate: int) -> dict[str, float]:
    """Record for `seconds` at `rate` cycles per second; return the measurements."""
    clock, shared = SystemClock(), SharedLayout.create()
    child = Child("recorder", MAIN, {}, shared)
    recorder, load = RemoteRecorder(child, shared), Load(shared)
    memory: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bench.mcap"
        recorder.start(path, HEADER)
        start_ns = clock.now_ns()
        cpu_before, _ = usage(child.pid)
        per_burst = rate * BURST_NS // NS_PER_S
        for burst in range(int(seconds * NS_PER_S / BURST_NS)):
            clock.sleep_until(start_ns + burst * BURST_NS)
            for _ in range(per_burst):
                # Time stamps of 500 Hz: the file is refused at any other rate.
                load.cycle(start_ns + load.cycles * PERIOD_NS)
            if burst % 100 == 0:
                memory.append(usage(child.pid)[1])
        cpu = usage(child.pid)[0] - cpu_before
        backlog = recorder.largest_backlog
        recorder.finish("bench")
        reader = TrialReader(path)
        written = len(reader.cycles().data)
        lost = int(reader.metadata["result"]["lost_in_ring"])
        size = path.stat().st_size
    child.stop()
    warm = memory[min(len(memory) // 2, 180) :]  # the ring buffers have wrapped by then
    return {
        "seconds": seconds,
        "rate": rate,
        "cycles": load.cycles,
        "written": written,
        "lost": lost,
        "largest_backlog": backlog,
        "slots": shared.cycles.slots,
        "cpu_share": round(cpu / seconds, 4),
        "us_per_cycle": round(cpu / load.cycles * 1e6, 2),
        "bytes_per_cycle": round(size / load.cycles, 1),
        "growth_kb_warm": round(warm[-1] - warm[0], 1),
        "cycle_bytes": CYCLE.size,
    }


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    results = run(10.0, 5000)
    return [
        BenchRow("recorder at 5000 cycles/s for 10 s: lost", results["lost"], "", 0),
        BenchRow("its processor time", results["us_per_cycle"], "us a cycle"),
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=int, default=500)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    results = run(args.seconds, args.rate)
    if args.json:
        print(json.dumps(results, indent=2))
        return
    for name, value in results.items():
        print(f"{name:18}{value}")


if __name__ == "__main__":
    main()
