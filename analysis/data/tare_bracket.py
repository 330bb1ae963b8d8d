"""The two tares around a trial: what the sensor's zero did meanwhile."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from acquisition.trial_file.data_files import read_data
from analysis.data.series import Array

_AXES = 6
_LARGEST = 1e6  # N, N m: beyond every sensor


@dataclass(frozen=True, slots=True)
class TareBracket:
    """The zero of the sensor before and after a trial.

    Attributes:
        times: of the two tares, from the first cycle of the trial [s].
        biases: reading without load at both [N, N m], shape (2, 6).
    """

    times: tuple[float, float]
    biases: Array

    @property
    def change(self) -> Array:
        """How far the zero has moved from one to the other [N, N m], shape (6,)."""
        return self.biases[1] - self.biases[0]

    def drift(self, t: Array) -> Array:
        """Return the change since the first tare at `t` [s], linear, shape (n, 6)."""
        first, second = self.times
        share = np.clip((t - first) / (second - first), 0.0, 1.0)
        return share[:, None] * self.change


def read_bracket(
    path: Path, trial: Mapping[str, str], bias: Array, start_ns: int
) -> TareBracket | None:
    """Return the tares around a trial; None where one of them is not known.

    The tare before the trial stands in its file, the one after it in the sidecar
    beside the file, which older recordings and the last trial of a session that was
    cut short do not have.

    Args:
        path: the trial file.
        trial: its metadata of that name.
        bias: reading without load that the file carries, shape (6,).
        start_ns: host time of the first cycle [ns].
    """
    before = _whole(trial.get("tared_ns"))
    try:
        sidecar: Any = json.loads(read_data(path.with_suffix(".json")))
    except (OSError, ValueError, RecursionError):
        return None
    entry = sidecar.get("next_tare") if isinstance(sidecar, dict) else None
    if before is None or not isinstance(entry, dict):
        return None
    fields = cast("dict[str, object]", entry)
    after, next_bias = _whole(fields.get("t_ns")), _wrench(fields.get("bias"))
    if after is None or next_bias is None or not before < start_ns < after:
        return None
    times = ((before - start_ns) * 1e-9, (after - start_ns) * 1e-9)
    return TareBracket(times, np.stack([bias, next_bias]))


def _whole(value: object) -> int | None:
    """Return a number of nanoseconds, None for anything else."""
    if isinstance(value, str) and value.isdecimal() and len(value) < 20:
        return int(value)
    return value if type(value) is int and value > 0 else None


def _wrench(value: object) -> Array | None:
    """Return six finite numbers, None for anything else."""
    if not isinstance(value, list) or len(cast("Sequence[object]", value)) != _AXES:
        return None
    numbers = [x for x in cast("list[object]", value) if isinstance(x, int | float)]
    is_sound = len(numbers) == _AXES and all(abs(x) < _LARGEST for x in numbers)
    return np.array(numbers, dtype=np.float64) if is_sound else None
