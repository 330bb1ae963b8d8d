"""The 500 Hz loop beside the same exchange in C, and a witness of stalls.

    python -m benchmarks.realtime [--seconds 60] [--windows 6] [--json]

The simulated rig is a process of its own that paces its frames like a wire, the wrist
sensor is asked in every cycle, the recorder is on, the arm is held by the control law.
The C programs are compiled here with `cc`. A miss is a cycle that began 0.5 ms late or
was skipped; one within 4 ms of a witnessed stall is explained by the machine.
"""

import argparse
import dataclasses
import json
import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

from acquisition.control_loop.realtime import choose_cores
from acquisition.sample import Record
from benchmarks.realtime_table import RawRecord, Times, Window, table
from experiments.preflight.loop_benchmark import run_bench
from experiments.preflight.preflight import start_devices
from experiments.rig.processes import MultiProcessBackend
from experiments.rig.rig import FakeOptions, Rig, build_rig
from experiments.settings.load import Settings, load_settings

C_FILES = Path(__file__).parent / "c"


def compiled(folder: Path) -> tuple[Path, Path]:
    """Return the programs (witness, exchange)."""
    compiler = shutil.which("cc")
    if compiler is None:
        sys.exit("No C compiler (cc) was found; the comparison needs one.")
    built: list[Path] = []
    for name in ("witness", "exchange"):
        target = folder / name
        source = C_FILES / f"{name}.c"
        subprocess.run([compiler, "-O2", "-o", target, source], check=True)
        built.append(target)
    return built[0], built[1]


def in_c(program: Path, core: int, seconds: float, bus: str = "") -> Window:
    """Run the C loop; with `bus`, the path of a served arm, the exchange too."""
    command = [str(program), str(core), str(seconds)] + ([bus] if bus else [])
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    return Window(
        np.array([line.split() for line in done.stdout.split("\n")[:-1]], int)
    )


def settings_with_bus_sensor() -> Settings:
    """Return the shipped settings with the wrist sensor on the arm's bus."""
    settings = load_settings(None)
    values = settings.rig.model_dump()
    shared = ("mass", "height", "angle_deg", "sign")  # by all makes
    sensor = {name: values["ft_sensor"][name] for name in shared}
    values["ft_sensor"] = {**sensor, "kind": "barrett"}
    rig = type(settings.rig).model_validate(values)
    return dataclasses.replace(settings, rig=rig)


def alternate(windows: int, seconds: float, core: int, program: Path) -> RawRecord:
    """Run the loop and the C programs in turn on `core`, `windows` times.

    Each window has a rig of its own: the frames of the C program are another master's.
    """
    settings, found = settings_with_bus_sensor(), RawRecord()
    for _ in range(windows):
        rig = build_rig(
            settings, settings.matrix.terrains[0], FakeOptions("processes", seed=1)
        )
        with closing(rig.backend):
            start_devices(rig)
            measure(rig, found, seconds, core, program)
    return found


def measure(
    rig: Rig, found: RawRecord, seconds: float, core: int, program: Path
) -> None:
    """Run the loop of `rig` and then the C programs; add to `found` what was seen."""
    backend = rig.backend
    assert isinstance(backend, MultiProcessBackend)
    processes = {**backend.processes(), "console": os.getpid()}
    kept: list[Times] = []
    timings = backend.loop_client.timings()
    backend.loop_client.on_tick.append(lambda: kept.append(columns(timings.read())))
    report = run_bench(rig, processes, seconds)
    if not report.is_powered:
        sys.exit(f"The arm was not held to the end of a window: {report.fault}")
    backend.loop_client.on_tick.pop()
    found.reports.append(report)
    found.loops.append(Window(np.concatenate(kept)))
    backend.loop_client.idle()
    backend.end_loop()
    found.wakes.append(in_c(program, core, seconds / 2))
    found.exchanges.append(in_c(program, core, seconds, backend.bus_path))


def columns(timings: Record) -> Times:
    """Return deadline, woke, replies, sent of records of the buffer of timings."""
    names = ("deadline_ns", "woke_ns", "replies_ns", "sent_ns")
    return np.column_stack([timings[name].astype(np.int64) for name in names])


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the loop")
    parser.add_argument("--windows", type=int, default=6)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    core, other = choose_cores()
    if core is None or other is None:
        sys.exit("Two processors are needed.")
    with tempfile.TemporaryDirectory() as name:
        witness, exchange = compiled(Path(name))
        length = str(args.seconds * 3 + 20 * args.windows + 60)
        seen = Path(name) / "stalls"
        with seen.open("w") as lines:
            watching = [
                subprocess.Popen([witness, str(c), length], stdout=lines)
                for c in (core, other)
            ]
            seconds = args.seconds / args.windows
            try:
                found = alternate(args.windows, seconds, core, exchange)
            finally:
                for process in watching:
                    process.terminate()
                    process.wait()
        text = seen.read_text().split("\n")[:-1]
        stalls = np.array([line.split() for line in text], int).reshape(-1, 2)
    rows = table(found, stalls)
    if args.json:
        print(json.dumps([dataclasses.asdict(row) for row in rows], indent=2))
        return
    for row in rows:
        word = {None: "", True: "met", False: "NOT MET"}[row.is_met]
        print(f"{row.what:50}{row.goal:24}{row.measured:36}{word}")


if __name__ == "__main__":
    main()
