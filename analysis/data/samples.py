"""Samples as models take them: columns, and where one trial ends."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array, Indices


@dataclass(frozen=True, slots=True)
class SampleTable:
    """Kept samples of one or more trials.

    Attributes:
        F_n: normal force [N], shape (n,).
        v_t: slip velocity [m/s], shape (n,).
        F_t: traction force [N], shape (n,).
    """

    F_n: Array
    v_t: Array
    F_t: Array

    @classmethod
    def of(cls, trials: Sequence[PreparedTrial]) -> "SampleTable":
        """Return the kept samples of `trials`, one after the other."""
        return cls.joined([cls(trial.F_n, trial.v_t, trial.F_t) for trial in trials])

    @classmethod
    def joined(cls, parts: Sequence["SampleTable"]) -> "SampleTable":
        """Return the rows of `parts`, one after the other."""
        empty = np.zeros(0)
        return cls(
            F_n=np.concatenate([empty, *(part.F_n for part in parts)]),
            v_t=np.concatenate([empty, *(part.v_t for part in parts)]),
            F_t=np.concatenate([empty, *(part.F_t for part in parts)]),
        )

    @property
    def count(self) -> int:
        """Number of rows."""
        return int(self.F_t.size)

    def take(self, indices: Indices) -> "SampleTable":
        """Return the rows at `indices`."""
        return SampleTable(self.F_n[indices], self.v_t[indices], self.F_t[indices])

    @property
    def inputs(self) -> Array:
        """Return (F_n, v_t) side by side, shape (n, 2)."""
        return np.column_stack([self.F_n, self.v_t])


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSet:
    """What a model is fitted to; compared and hashed as the object it is.

    Attributes:
        rows: kept samples of all training trials, one trial after the other.
        lengths: number of rows of every trial.
        chosen: the rows that a Gaussian process is given.
    """

    rows: SampleTable
    lengths: tuple[int, ...]
    chosen: Indices

    @property
    def subset(self) -> SampleTable:
        """Return the chosen rows."""
        return self.rows.take(self.chosen)

    def trial_of(self) -> Indices:
        """Return the number of the trial of every row, shape (n,)."""
        return np.repeat(np.arange(len(self.lengths)), self.lengths)
