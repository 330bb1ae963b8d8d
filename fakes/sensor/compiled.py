# pyright: basic
"""Errors and frames of the usual wrist sensor as records, by compiled functions.

What the gauges add follows the equations of `fakes.sensor.errors`, to the last bit. A
frame that anything disturbs - a fault, a range, a line that is too slow - is made as in
every other sensor, by `SensorStream`.
"""

import math
from collections.abc import Sequence
from struct import Struct

import numpy as np

from fakes.kernels.compiler import inline, kernel
from fakes.randomness import NormalArray
from fakes.sensor.bota import BotaFirmware
from fakes.sensor.errors import (
    CREEP_TIME,
    PER_DEGREE,
    SLOW_NS,
    WARMTH_TIME,
    ErrorScale,
    SensorErrors,
)
from fakes.sensor.stream import ROOM, SensorStream, Source
from ft_sensor.reading import Wrench
from ft_sensor.vendors import bota

_SIX = (6,)
_OF_SCALES = ("drift", "drift_time", "walk", "walk_time", "white", "resolution")
_OF_LOAD = ("creep", "hysteresis", "lagging", "stretch")
_ERRORS = np.dtype(
    [
        ("load", float, _SIX),  # first: it is packed into the record's beginning
        ("shown", float, _SIX),
        *((name, float, _SIX) for name in _OF_SCALES),
        *((name, float, _SIX) for name in _OF_LOAD),
        ("before", float, _SIX),  # the load at the last slow step
        ("taken_on", float, _SIX),  # the load that the reading has crept to
        ("cross_talk", float, (6, 6)),
        ("per_degree", float, _SIX),
        ("shift", float, _SIX),
        ("drifts", float, _SIX),
        ("walks", float, _SIX),
        ("slow", float, _SIX),
        ("keep", float, _SIX),  # of the drifts, in a step of `step_ns`
        ("kick", float, _SIX),
        ("warmth", float),
        ("warmth_sd", float),
        ("t_ns", np.int64),
        ("slow_ns", np.int64),
        ("step_ns", np.int64),
        ("is_begun", np.int64),
    ],
    align=True,
)
_LOAD = Struct("6d")
_MOST_DRAWN = 19  # normal numbers that one sample may take


class CompiledErrors(SensorErrors):
    """The same errors over a record.

    Attributes:
        records: the record, as an array of one.
    """

    is_compiled = True

    def __init__(self, rng: np.random.Generator, *scales: ErrorScale) -> None:
        """Draw the sensor from `rng`; see `SensorErrors`."""
        self._bytes = bytearray(_ERRORS.itemsize)
        self.records = np.frombuffer(self._bytes, _ERRORS)
        self._record = record = self.records[0]
        super().__init__(rng, *scales)
        for name in _OF_SCALES:
            record[name] = [getattr(scale, name) for scale in self._scales]
        record["warmth_sd"] = self._warmth_sd
        record["drifts"], record["walks"] = self._drifts, self._walk
        record["per_degree"] = PER_DEGREE
        record["cross_talk"] = self._load_errors.cross_talk
        rows = self._load_errors.rows
        record["creep"], record["hysteresis"], record["lagging"] = np.transpose(rows)
        record["step_ns"] = -1
        self._shown = record["shown"]
        _compile(self.records.copy())

    @property
    def warmth(self) -> float:
        """How far the sensor is from its usual temperature [degrees Celsius]."""
        return float(self._record["warmth"])

    @warmth.setter
    def warmth(self, warmth: float) -> None:
        self._record["warmth"] = warmth

    @property
    def shift(self) -> Wrench:
        """What a fault has added to the zero [N, N m]."""
        fx, fy, fz, tx, ty, tz = self._record["shift"].tolist()
        return fx, fy, fz, tx, ty, tz

    @shift.setter
    def shift(self, shift: Wrench) -> None:
        self._record["shift"] = shift

    def draw_from(self, rng: np.random.Generator) -> None:
        """Draw everything random from `rng` from now on; the process goes on."""
        self._normals = self._numbers = NormalArray(rng)

    def bear(self, wrench: Sequence[float]) -> NormalArray:
        """Put the load of the next sample on the gauges; return what `show` takes."""
        _LOAD.pack_into(self._bytes, 0, *wrench)
        self._numbers.keep_ready(_MOST_DRAWN)
        return self._numbers

    def apply(self, t_ns: int, wrench: Sequence[float]) -> Wrench:
        """Return what is shown at `t_ns` under `wrench` [N, N m], shape (6,)."""
        numbers = self.bear(wrench)
        _show(self.records, numbers.numbers, numbers.taken, t_ns)
        fx, fy, fz, tx, ty, tz = self._shown.tolist()
        return fx, fy, fz, tx, ty, tz


@kernel
def _show(errors, numbers, taken, t_ns):
    show(errors[0], numbers, taken, t_ns)


@inline
def show(e, numbers, taken, t_ns):
    """Fill `shown` with the reading at `t_ns` under `load` [N, N m]."""
    step_ns = t_ns - e.t_ns if e.is_begun and t_ns > e.t_ns else 0
    if step_ns != e.step_ns:
        _pace_drifts(e, step_ns)
    if not e.is_begun or t_ns - e.slow_ns >= SLOW_NS:
        _step_slowly(e, numbers, taken, t_ns)
    e.t_ns, e.is_begun = t_ns, 1
    at = taken[0]
    for i in range(6):
        moved = e.keep[i] * e.drifts[i] + e.kick[i] * numbers[at]
        value = e.load[i] + e.slow[i] + moved + e.white[i] * numbers[at + 1]
        at += 2
        e.drifts[i] = moved
        step = e.resolution[i]
        # Adding zero makes no negative one, as Python's integers have none.
        e.shown[i] = (np.rint(value / step) + 0.0) * step if step else value
    taken[0] = at


@inline
def _exact_step(sd, time, dt):
    keep = math.exp(-dt / time)
    return keep, sd * math.sqrt(1.0 - keep * keep)


@inline
def _pace_drifts(e, step_ns):
    """Let the drifts step by `step_ns` from now on."""
    e.step_ns = step_ns
    for i in range(6):
        e.keep[i], e.kick[i] = _exact_step(e.drift[i], e.drift_time[i], step_ns * 1e-9)


@inline
def _step_slowly(e, numbers, taken, t_ns):
    """Let walk, warmth and the effects of the load go on to `t_ns`."""
    dt = (t_ns - e.slow_ns) * 1e-9 if e.is_begun else 0.0
    e.slow_ns = t_ns
    at = taken[0]
    keep, kick = _exact_step(e.warmth_sd, WARMTH_TIME, dt)
    e.warmth = keep * e.warmth + kick * numbers[at]
    for i in range(6):
        at += 1
        keep, kick = _exact_step(e.walk[i], e.walk_time[i], dt)
        e.walks[i] = keep * e.walks[i] + kick * numbers[at]
    taken[0] = at + 1
    share = 1.0 - math.exp(-dt / CREEP_TIME)
    for i in range(6):
        error = _of_load(e, i, share)
        e.slow[i] = e.walks[i] + e.warmth * e.per_degree[i] + e.shift[i] + error
    for i in range(6):
        e.before[i] = e.load[i]


@inline
def _of_load(e, i, share):
    """Return what the load makes axis `i` miss, as `LoadErrors` does."""
    load, most = e.load[i], e.lagging[i]
    if not e.is_begun:
        e.before[i] = e.taken_on[i] = load
    talk = e.cross_talk[i, 0] * e.load[0]
    for j in range(1, 6):
        talk += e.cross_talk[i, j] * e.load[j]
    moved = e.stretch[i] + load - e.before[i]
    lag = most if moved > most else -most if moved < -most else moved
    slow = e.taken_on[i] + share * (load - e.taken_on[i])
    e.stretch[i], e.taken_on[i] = lag, slow
    return e.creep[i] * (slow - load) - e.hysteresis[i] * lag + talk


# The frame lies one byte in, so that every number of it lies where it is fast.
_FRAME = np.dtype(
    [
        ("before", np.uint8),
        ("header", np.uint8),
        ("status", np.uint16),
        ("wrench", np.float32, (6,)),
        ("device_us", np.uint32),
        ("temperature", np.float32),
        ("crc", np.uint16),
    ],
    align=True,
)
_END = 1 + bota.FRAME_SIZE
_POLYNOMIAL, _START = 0x8408, 0xFFFF  # of CRC-16/X-25, bits reversed


def _crc_table() -> np.ndarray:
    table = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        table = (table >> 1) ^ (table & 1) * np.uint16(_POLYNOMIAL)
    return table


_TABLE = _crc_table()


class CompiledBotaStream(SensorStream):
    """A `SensorStream` of a bota with compiled errors."""

    def __init__(
        self,
        firmware: BotaFirmware,
        source: Source,
        errors: SensorErrors,
        start_ns: int = 0,
        clock_start_us: int = 0,
    ) -> None:
        """Switch the device on at `start_ns`, or find it running."""
        self._bytes = bytearray(_FRAME.itemsize)
        self._frames = np.frombuffer(self._bytes, _FRAME)
        self._frames["header"] = bota.HEADER
        self._raw = np.frombuffer(self._bytes, np.uint8)
        self._bota = firmware
        super().__init__(firmware, source, errors, start_ns, clock_start_us)

    def _take_sample(self, t_ns: int, period_ns: float) -> None:
        errors = self.errors
        if not isinstance(errors, CompiledErrors) or not self._is_plain(
            t_ns, period_ns
        ):
            super()._take_sample(t_ns, period_ns)
            return
        numbers = errors.bear(self._source(t_ns))
        self._number += 1
        self._read_clock(t_ns)
        _take(
            errors.records,
            (numbers.numbers, numbers.taken),
            (self._frames, self._raw),
            (t_ns, self._device_us, self._bota.is_raw << 3),
        )
        self._send(t_ns, bytes(self._bytes[1:_END]))


def _compile(errors: np.ndarray) -> None:
    """Have the machine code before the first sample is due; `errors` are nobody's."""
    normals = np.zeros(_MOST_DRAWN), np.zeros(1, np.int64)
    frames = np.frombuffer(bytearray(_FRAME.itemsize), _FRAME)
    _show(errors, *normals, 0)
    normals[1][0] = 0
    _take(errors, normals, (frames, frames.view(np.uint8)), (0, 0, 0))


@kernel
def _take(errors, normals, frame, shown):
    """Fill the frame with the sample at a time [ns], a clock [us], under a status."""
    frames, raw = frame
    t_ns, device_us, status = shown
    e, f = errors[0], frames[0]
    show(e, normals[0], normals[1], t_ns)
    f.status = status
    for i in range(6):
        f.wrench[i] = e.shown[i]
    f.device_us = device_us & 0xFFFFFFFF
    f.temperature = ROOM + e.warmth
    crc = _START
    for k in range(2, 36):
        crc = crc >> 8 ^ _TABLE[(crc ^ raw[k]) & 0xFF]
    f.crc = crc ^ 0xFFFF
