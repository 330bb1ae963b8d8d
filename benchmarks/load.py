"""Speed of loading trial files into arrays, compared with other readers.

    python -m benchmarks.load [--trials 80] [--seconds 30] [--rounds 7] [--json]

The recorder's own writer writes the trials: cycles with encoder and sensor noise, views
at 50 Hz, sensor samples, a chunk every 0.25 s. A few trials are distinct, the others
are copied files. All are then loaded one after the other on one core. One trial is read
by all readers in turn, and their results are compared; times are medians of CPU time
over the rounds. Files are in the page cache.
"""

import argparse
import json
import os
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from numpy.typing import NDArray

from acquisition.ipc.shared_sensor import WRENCH_DTYPE
from acquisition.recording.recorder import seal
from acquisition.sample import Flag, Record
from acquisition.schema import CYCLE, schema_text
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.writer import TrialHeader, TrialWriter
from benchmarks.rows import BenchRow, not_installed

GOAL_SECONDS = 5.0  # wall time for 80 trials of 30 s
GOAL_ITERATING = 5.0  # times faster than iter_messages + frombuffer
GOAL_DECODING = 20.0  # times faster than mcap-ros2-support
_DISTINCT = 4
_RATE_HZ = 500
_BLOCK = _RATE_HZ // 4  # cycles between two flushes
_SENSOR_PERIOD_NS = 1_250_000  # 800 Hz
_START_NS = 10**12
Positions = NDArray[np.float64]  # rad, shape (n, 7)
_HEADER = TrialHeader(
    trial={"session": "bench", "simulated": "true"},
    utc_offset_ns=1_700_000_000_000_000_000,
    offset_uncertainty_ns=100,
    provenance={},
    attachments={},
    robot_description="<robot name='wam7'/>",
)


@dataclass(frozen=True, slots=True)
class Side:
    """One way to read a trial.

    Attributes:
        name: name of the reader.
        median_ms: median CPU time of one trial [ms].
        ratio: that time over this project's reader's.
    """

    name: str
    median_ms: float
    ratio: float


def make_cycles(seconds: float, rng: np.random.Generator) -> Record:
    """Return cycles of a pushed arm: smooth motion with noise of realistic size."""
    count = round(seconds * _RATE_HZ)
    out = np.frombuffer(bytearray(CYCLE.template * count), CYCLE.dtype)
    out["cycle"] = np.arange(count)
    out["host_ns"] = _START_NS + np.arange(count) * 2_000_000
    out["host_ns"] += rng.integers(0, 60_000, count).astype(np.uint64)
    out["arm_ns"] = out["host_ns"] + rng.integers(600_000, 900_000, count).astype("u8")
    out["ft_ns"] = out["host_ns"] - rng.integers(0, 1_250_000, count).astype("u8")
    out["ft_counter"] = out["ft_ns"] // 1000
    out["flags"] = 2 | Flag.ARM_FRESH | Flag.FT_FRESH
    walk = np.cumsum(rng.normal(0.0, 1e-4, (count, 7)), axis=0)
    out["counts"] = np.round(walk * 26_000)
    out["position"] = out["counts"] / 26_000.0
    out["velocity"] = np.gradient(out["position"], 0.002, axis=0)
    out["torque_gravity"] = np.sin(out["position"]) * 8.0
    out["torque_command"] = np.round(out["torque_gravity"] / 0.005) * 0.005
    for name in ("wrench_raw", "wrench"):
        out[name] = rng.normal(0.0, 0.08, (count, 6)) + out["position"][:, :6]
    out["foot_position"] = walk[:, :3]
    out["foot_orientation"] = (0.0, 1.0, 0.0, 0.0)
    out["foot_velocity"] = np.gradient(walk[:, :6], 0.002, axis=0)
    out["traction"] = out["wrench"][:, :3] + rng.normal(0.0, 0.01, (count, 3))
    return out


def write_trial(path: Path, seconds: float, seed: int) -> None:
    """Write one trial in the recorder's format."""
    rng = np.random.default_rng(seed)
    cycles = make_cycles(seconds, rng)
    samples = np.zeros(round(seconds * 1e9 / _SENSOR_PERIOD_NS), WRENCH_DTYPE)
    samples["t_ns"] = _START_NS + np.arange(len(samples)) * _SENSOR_PERIOD_NS
    samples["counter"] = samples["t_ns"] // 1000
    samples["wrench"] = rng.normal(0.0, 0.08, (len(samples), 6))
    writer = TrialWriter(path, _HEADER)
    blocks = -(-len(cycles) // _BLOCK)
    for block, wrenches in enumerate(np.array_split(samples, blocks)):
        writer.write_cycles(cycles[block * _BLOCK : (block + 1) * _BLOCK])
        writer.write_wrenches(wrenches)
        writer.flush()
    seal(writer, "bench")


def write_trials(folder: Path, trials: int, seconds: float) -> list[Path]:
    """Write `trials` trial files below `folder` and return their paths."""
    paths = [folder / f"T{number:03d}.mcap" for number in range(trials)]
    for number, path in enumerate(paths):
        if number < _DISTINCT:
            write_trial(path, seconds, number)
        else:
            shutil.copyfile(paths[number % _DISTINCT], path)
    return paths


def this_reader(path: Path) -> Positions:
    """Read a trial with this project's reader."""
    return TrialReader(path).cycles().data["position"]


def iterating(path: Path) -> Positions:
    """Read a trial message by message with mcap's own reader."""
    return _joined(path, in_order=True)


def iterating_unsorted(path: Path) -> Positions:
    """Read like `iterating` in file order, without the heap of mcap's reader."""
    return _joined(path, in_order=False)


def _joined(path: Path, *, in_order: bool) -> Positions:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        messages = reader.iter_messages(topics="/cycle", log_time_order=in_order)
        joined = b"".join(message.data for _, _, message in messages)
    return np.frombuffer(joined, CYCLE.dtype)["position"]


def decoding_with_ros2(path: Path) -> Positions:
    """Decode every message with mcap-ros2-support."""
    from mcap_ros2.decoder import DecoderFactory  # pyright: ignore[reportMissingImports]

    with path.open("rb") as file:
        reader = make_reader(
            file, validate_crcs=True, decoder_factories=[DecoderFactory()]
        )
        messages = reader.iter_decoded_messages(topics="/cycle")
        return np.array([decoded.position for _, _, _, decoded in messages])


def decoding_with_rosbags(path: Path) -> Positions:
    """Decode every message with rosbags."""
    from rosbags.rosbag2.storage_mcap import McapReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(schema_text(CYCLE.type_name), CYCLE.type_name))
    reader = McapReader(path)
    reader.open()
    try:
        connections = [c for c in reader.connections if c.topic == "/cycle"]
        rows = [
            store.deserialize_cdr(data, CYCLE.type_name).position  # pyright: ignore[reportAttributeAccessIssue]
            for _, _, data in reader.messages(connections)
        ]
    finally:
        reader.close()
    return np.array(rows)


def readers() -> dict[str, Callable[[Path], Positions]]:
    """Return the installed readers by name, this project's first."""
    functions = {
        "this reader": this_reader,
        "mcap iter_messages + frombuffer": iterating,
        "mcap iter_messages without sorting": iterating_unsorted,
        "rosbags, decoded": decoding_with_rosbags,
    }
    try:
        import mcap_ros2.decoder  # noqa: F401 # pyright: ignore[reportMissingImports]
    except ImportError:
        return functions
    return functions | {"mcap-ros2-support, decoded": decoding_with_ros2}


def compare(path: Path, rounds: int) -> list[Side]:
    """Read one trial with every reader in turn, after one warm-up round.

    Raises:
        RuntimeError: a reader returns other positions.
    """
    times_ms: dict[str, list[float]] = {name: [] for name in readers()}
    positions = TrialReader(path).cycles().data["position"]
    for _ in range(rounds + 1):
        for name, read in readers().items():
            start = time.process_time()
            read_positions = read(path)
            times_ms[name].append((time.process_time() - start) * 1e3)
            if read_positions.tobytes() != positions.tobytes():
                raise RuntimeError(f"{name} reads other positions")
    medians = {name: statistics.median(times[1:]) for name, times in times_ms.items()}
    ours = medians["this reader"]
    return [Side(name, median, median / ours) for name, median in medians.items()]


def load_all(paths: list[Path]) -> dict[str, float]:
    """Load every trial once; return wall and CPU time [s], and peak memory [MB]."""
    Path("/proc/self/clear_refs").write_text("5")  # reset the peak memory counter
    wall, cpu = time.perf_counter(), time.process_time()
    cycles = sum(len(TrialReader(path).cycles().data) for path in paths)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {
        "wall_s": wall,
        "cpu_s": cpu,
        "cycles": cycles,
        "peak_mb": _status_mb("VmHWM"),
    }


def _status_mb(field: str) -> float:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(f"{field}:"):
            return int(line.split()[1]) / 1024
    raise RuntimeError(f"no {field} in /proc/self/status")


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "T01.mcap"
        write_trial(path, 30.0, 1)
        sides = {side.name: side for side in compare(path, 3)}
    goals = {
        "mcap iter_messages + frombuffer": GOAL_ITERATING,
        "mcap-ros2-support, decoded": GOAL_DECODING,
    }
    return [
        BenchRow("cycles of one 30 s trial read", sides["this reader"].median_ms, "ms"),
        *(
            BenchRow(
                f"the same against {name}",
                sides[name].ratio,
                "times",
                goal,
                is_lower_bound=True,
            )
            if name in sides
            else not_installed(f"the same against {name}", goal)
            for name, goal in goals.items()
        ),
    ]


def main() -> None:
    """Write, load, compare and print; the exit code ignores the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--trials", type=int, default=80, metavar="N")
    parser.add_argument("--seconds", type=float, default=30.0, metavar="S")
    parser.add_argument("--rounds", type=int, default=7, metavar="N")
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    args = parser.parse_args()
    if args.trials < 1 or args.seconds < 1.0 or args.rounds < 1:
        parser.error("expected at least 1 trial, 1 second and 1 round")
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory() as folder:
        paths = write_trials(Path(folder), args.trials, args.seconds)
        file_mb = paths[0].stat().st_size / 2**20
        loaded = load_all(paths)
        sides = compare(paths[0], args.rounds)
    if args.json:
        report = {"trials": args.trials, "seconds": args.seconds, "file_mb": file_mb}
        report |= {"loaded": loaded, "sides": [asdict(side) for side in sides]}
        print(json.dumps(report, indent=2))
        return
    print(
        f"{args.trials} trials of {args.seconds:g} s, {file_mb:.1f} MB each: "
        f"{loaded['wall_s']:.2f} s wall, {loaded['cpu_s']:.2f} s CPU on one core "
        f"(goal {GOAL_SECONDS:g} s for 80 of 30 s); peak memory "
        f"{loaded['peak_mb']:.0f} MB"
    )
    for side in sides:
        print(f"{side.name:34}{side.median_ms:9.1f} ms CPU{side.ratio:8.1f} x")
    print(
        f"goals: {GOAL_ITERATING:g} x against iter_messages, {GOAL_DECODING:g} x "
        "against mcap-ros2-support"
    )


if __name__ == "__main__":
    main()
