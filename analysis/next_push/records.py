"""What a kept trial leaves for the choice of the next one: a few rows, its slips.

Rows come in runs of neighbours: single rows lie several correlation times apart, where
the residual along a trial and the noise of a sample look alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import (
    BaseModel,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    field_validator,
)

from acquisition.settings import Number
from acquisition.validation import Many
from analysis.breakaway.pushes import find_pushes
from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array

ROWS = 25  # of a trial
_RUN, _APART = 5, 4  # neighbours together, kept samples from one to the next
_DIGITS = 4
_MOST_SLIPS = 200
_LARGEST = 1e6  # of any number in a record
_LEAST = (0.1, 0.001)  # N, m/s
_Number = Annotated[Number, Field(strict=True, gt=-_LARGEST, lt=_LARGEST)]
_Column = Annotated[Many[_Number], Field(min_length=1, max_length=ROWS)]


class Aim(NamedTuple):
    """Where a push is aimed at.

    Attributes:
        F_n: mean load while the foot moves [N].
        v_t: mean velocity while it moves [m/s].
    """

    F_n: _Number
    v_t: _Number

    @property
    def log(self) -> Array:
        """Logarithms of both, of 0.1 N and 1 mm/s at least, shape (2,).

        A short trial may have lifted the foot, or moved it back, in the mean.
        """
        return np.log(np.maximum(np.array([self.F_n, self.v_t]), _LEAST))


@dataclass(frozen=True, slots=True)
class PushRecord:
    """One kept trial, as the choice of the next needs it.

    Attributes:
        F_n: normal force of a few kept samples [N], shape (n,).
        v_t: their velocity [m/s], shape (n,).
        F_t: their traction force [N], shape (n,).
        t: their time [s], shape (n,).
        slips: normal force at the peaks that ended in a slip [N], shape (s,).
        mean: of load and velocity over all kept samples.
        aim: what the push was aimed at; None where nobody asked for anything.
    """

    F_n: Array
    v_t: Array
    F_t: Array
    t: Array
    slips: Array
    mean: Aim
    aim: Aim | None = None

    def plain(self) -> dict[str, Any]:
        """Return the record as it stands in a sidecar."""
        columns = {"F_n": self.F_n, "v_t": self.v_t, "F_t": self.F_t, "t": self.t}
        return {key: _short(column) for key, column in columns.items()} | {
            "slips": _short(self.slips),
            "mean": _short(self.mean),
            "aim": None if self.aim is None else _short(self.aim),
        }

    @classmethod
    def from_plain(cls, value: object) -> "PushRecord | None":
        """Return a record from a sidecar; None where there is none or it is damaged."""
        try:
            stored = _StoredRecord.model_validate(value)
        except ValidationError:
            return None
        columns = (stored.F_n, stored.v_t, stored.F_t, stored.t)
        if len(set(map(len, columns))) > 1:
            return None
        F_n, v_t, F_t, t = map(np.array, columns)
        return cls(F_n, v_t, F_t, t, np.array(stored.slips), stored.mean, stored.aim)


class _StoredRecord(BaseModel):
    """A record as it stands in a sidecar; a damaged aim costs the aim only."""

    F_n: _Column
    v_t: _Column
    F_t: _Column
    t: _Column
    slips: Annotated[Many[_Number], Field(max_length=_MOST_SLIPS)]
    mean: Aim
    aim: Aim | None = None

    @field_validator("aim", mode="wrap")
    @classmethod
    def _sound_aim(
        cls, value: object, validate: ValidatorFunctionWrapHandler
    ) -> Aim | None:
        try:
            return validate(value)
        except ValidationError:
            return None


def push_record(trial: PreparedTrial, aim: Aim | None = None) -> PushRecord | None:
    """Return what a trial leaves; None with fewer kept samples than one run.

    Args:
        trial: the prepared trial.
        aim: what the push was aimed at.
    """
    span = _RUN * _APART
    if trial.kept < span:
        return None
    runs = min(ROWS // _RUN, trial.kept // span)
    starts = np.linspace(0, trial.kept - span, runs).round().astype(np.intp)
    rows = (starts[:, None] + _APART * np.arange(_RUN)).ravel()
    slips = [p.F_n for p in find_pushes(trial) if not p.is_held][:_MOST_SLIPS]
    mean = Aim(float(trial.F_n.mean()), float(trial.v_t.mean()))
    columns = (trial.F_n[rows], trial.v_t[rows], trial.F_t[rows])
    t = trial.smooth.t[trial.indices[rows]]
    return PushRecord(*columns, t, np.array(slips, float), mean, aim)


def _short(values: Sequence[float] | Array) -> list[float]:
    return [round(float(value), _DIGITS) for value in values]
