"""Synthetic trials, and MCAP files taken apart and sealed again."""

import struct
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.clock import PERIOD_NS
from acquisition.sample import Flag
from acquisition.schema import CYCLE
from acquisition.trial_file.writer import (
    TRIAL_TOPICS,
    TrialHeader,
    TrialWriter,
)

START_NS = 5_000_000_000
OFFSET_NS = 1_700_000_000_123_456_789
ATTACHMENTS = {
    "config.toml": b"[rig]\narm = 'wam7'\n",
    "arm_model.toml": bytes(range(256)) * 20,
}
MAGIC_BYTES = 8
FOOTER_BYTES = 29
DATA_END_BYTES = 13


def make_header(**changes):
    fields: dict[str, Any] = {
        "trial": {"session": "S", "trial": "T01", "simulated": "true"},
        "utc_offset_ns": OFFSET_NS,
        "offset_uncertainty_ns": 80,
        "provenance": {"software": "0.1.0"},
        "attachments": ATTACHMENTS,
        "robot_description": "<robot name='wam7'/>",
    }
    return TrialHeader(**(fields | changes))


def make_cycles(count=600, *, first=1000, skipped=(), seed=0) -> Any:
    """Return records of the loop; the numbers in `skipped` are left out."""
    rng = np.random.default_rng(seed)
    numbers = np.setdiff1d(np.arange(first, first + count + len(skipped)), skipped)
    out = np.frombuffer(bytearray(CYCLE.template * len(numbers)), CYCLE.dtype)
    out["cycle"] = numbers
    out["host_ns"] = START_NS + (numbers - first) * PERIOD_NS
    out["arm_ns"] = out["host_ns"] + 700_000
    out["flags"] = 2 | Flag.ARM_FRESH | Flag.FT_FRESH
    out["counts"] = rng.integers(-40_000, 40_000, (len(numbers), 7))
    for name in ("position", "velocity", "torque_command", "wrench", "wrench_raw"):
        out[name] = rng.normal(size=out[name].shape)
    out["foot_position"] = rng.normal(size=(len(numbers), 3))
    out["foot_orientation"] = (0.0, 1.0, 0.0, 0.0)
    out["foot_velocity"] = rng.normal(size=(len(numbers), 6))
    return out


def write_trial(path, cycles, header=None, *, block=125, topics=TRIAL_TOPICS):
    """Write `cycles` in blocks, one chunk each; the file is not finished."""
    writer = TrialWriter(path, header or make_header(), topics)
    for start in range(0, len(cycles), block):
        writer.write_cycles(cycles[start : start + block])
        writer.flush()
    return writer


@dataclass(frozen=True)
class Span:
    """A top-level MCAP record: opcode, and its bytes from `start` to `end`."""

    opcode: int
    start: int
    end: int

    @property
    def body(self):
        return self.start + 9


def spans(data):
    """Return the top-level records of an MCAP file."""
    found, at = [], MAGIC_BYTES
    while at < len(data) - MAGIC_BYTES:
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append(Span(opcode, at, at + 9 + length))
        at += 9 + length
    return found


def span_of(data, opcode, index=0):
    return [span for span in spans(data) if span.opcode == opcode][index]


def summary_start(data):
    return struct.unpack_from("<Q", data, len(data) - MAGIC_BYTES - FOOTER_BYTES + 9)[0]


def resealed(data):
    """Return `data` with both section checksums recomputed.

    As a forger would do, but never a damaged disk.
    """
    data = bytearray(data)
    summary = summary_start(data)
    end = len(data) - MAGIC_BYTES - 4
    struct.pack_into("<I", data, end, zlib.crc32(data[summary:end]))
    data_end = summary - DATA_END_BYTES
    if 0 < data_end < end:
        struct.pack_into("<I", data, summary - 4, zlib.crc32(data[:data_end]))
    return bytes(data)


def flipped(data, at, bit=0):
    data = bytearray(data)
    data[at] ^= 1 << bit
    return bytes(data)
