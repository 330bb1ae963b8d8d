"""The two tares around a trial: what the sensor's zero did meanwhile."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, TypeAdapter

from acquisition.settings import Number
from acquisition.trial_file.data_files import read_data
from analysis.data.series import Array

# Between two tares the zero of a good sensor wanders by 0.3 N on each axis. A foot that
# came loose, a knock or another gain moves it farther.
LARGEST_CHANGE = 2.0  # N
_LARGEST = 1e6  # N, N m: beyond every sensor
_Axis = Annotated[Number, Field(strict=True, gt=-_LARGEST, lt=_LARGEST)]
_Time = Annotated[int, Field(ge=0, lt=10**19)]  # ns
_TIME = TypeAdapter(_Time)


class _NextTare(BaseModel):
    t_ns: _Time
    bias: tuple[_Axis, _Axis, _Axis, _Axis, _Axis, _Axis]


class _Sidecar(BaseModel):
    next_tare: _NextTare


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

    @property
    def force_change(self) -> float:
        """How far the zero of the force has moved from one to the other [N]."""
        return float(np.linalg.norm(self.change[:3]))

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
    beside the file, which the last trial of a session that was cut short does not have.

    Args:
        path: the trial file.
        trial: its metadata of that name.
        bias: reading without load that the file carries, shape (6,).
        start_ns: host time of the first cycle [ns].
    """
    try:
        before = _TIME.validate_python(trial.get("tared_ns"))
        sidecar = json.loads(read_data(path.with_suffix(".json")))
        tare = _Sidecar.model_validate(sidecar).next_tare
    except (OSError, ValueError, RecursionError):
        return None
    if not before < start_ns < tare.t_ns:
        return None
    times = ((before - start_ns) * 1e-9, (tare.t_ns - start_ns) * 1e-9)
    return TareBracket(times, np.array([bias, tare.bias]))
