"""The tares before and after a trial, and the zero drift between them."""

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

# Between two tares the zero of a good sensor drifts by 0.3 N on each axis. A loose
# foot, a knock or another gain moves it further.
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
        times: times of the two tares, from the first cycle of the trial [s].
        biases: unloaded readings at both tares [N, N m], shape (2, 6).
    """

    times: tuple[float, float]
    biases: Array

    @property
    def change(self) -> Array:
        """Change of the zero between the two tares [N, N m], shape (6,)."""
        return self.biases[1] - self.biases[0]

    @property
    def force_change(self) -> float:
        """Magnitude of the change of the force zero between the two tares [N]."""
        return float(np.linalg.norm(self.change[:3]))

    def drift(self, t: Array) -> Array:
        """Interpolate the change since the first tare at `t` [s], shape (n, 6)."""
        first, second = self.times
        share = np.clip((t - first) / (second - first), 0.0, 1.0)
        return share[:, None] * self.change


def read_bracket(
    path: Path, trial: Mapping[str, str], bias: Array, start_ns: int
) -> TareBracket | None:
    """Read the tares around a trial; None if one of them is not known.

    The tare before the trial is in its file, the one after it in its sidecar, which the
    last trial of an aborted session lacks.

    Args:
        path: the trial file.
        trial: the metadata section "trial" of the file.
        bias: unloaded reading in the file, shape (6,).
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
