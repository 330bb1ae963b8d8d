"""Tables of samples for model fitting, with the length of every trial."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array, Indices


def inputs_of(F_n: Array, v_t: Array, further: Array | None = None) -> Array:
    """Stack the model inputs as columns, shape (n, 2 + k).

    Args:
        F_n: normal force [N], shape (n,).
        v_t: slip velocity [m/s], shape (n,).
        further: other inputs, shape (n, k); None for none.
    """
    return np.column_stack([F_n, v_t] if further is None else [F_n, v_t, further])


@dataclass(frozen=True, slots=True)
class SampleTable:
    """Kept samples of one or more trials.

    Attributes:
        F_n: normal force [N], shape (n,).
        v_t: slip velocity [m/s], shape (n,).
        F_t: traction force [N], shape (n,).
        further: other inputs, shape (n, k); None where there are none.
    """

    F_n: Array
    v_t: Array
    F_t: Array
    further: Array | None = None

    @classmethod
    def of(cls, trials: Sequence[PreparedTrial]) -> "SampleTable":
        """Return the kept samples of `trials`, one after the other."""
        return cls.joined([cls(t.F_n, t.v_t, t.F_t, t.further) for t in trials])

    @classmethod
    def joined(cls, parts: Sequence["SampleTable"]) -> "SampleTable":
        """Return the rows of `parts`, one after the other."""
        empty = np.zeros(0)
        further = [part.further for part in parts if part.further is not None]
        return cls(
            F_n=np.concatenate([empty, *(part.F_n for part in parts)]),
            v_t=np.concatenate([empty, *(part.v_t for part in parts)]),
            F_t=np.concatenate([empty, *(part.F_t for part in parts)]),
            further=np.concatenate(further) if further else None,
        )

    @property
    def count(self) -> int:
        """Number of rows."""
        return int(self.F_t.size)

    def take(self, indices: Indices) -> "SampleTable":
        """Return the rows at `indices`."""
        further = None if self.further is None else self.further[indices]
        return SampleTable(
            self.F_n[indices], self.v_t[indices], self.F_t[indices], further
        )

    @property
    def inputs(self) -> Array:
        """F_n, v_t and further inputs as columns, shape (n, 2 + k)."""
        return inputs_of(self.F_n, self.v_t, self.further)


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSet:
    """Training data of a model; compared and hashed by identity.

    Attributes:
        rows: kept samples of all training trials, one trial after the other.
        lengths: number of rows of every trial.
        chosen: indices of the rows that a Gaussian process is fitted to.
    """

    rows: SampleTable
    lengths: tuple[int, ...]
    chosen: Indices

    @classmethod
    def of(
        cls, trials: Sequence[PreparedTrial], points: int, seed: int
    ) -> "TrainingSet":
        """Take all kept samples of `trials` and choose `points` of them at random."""
        rows = SampleTable.of(trials)
        rng = np.random.default_rng(seed)
        chosen = rng.choice(rows.count, min(points, rows.count), replace=False)
        return cls(rows, tuple(trial.kept for trial in trials), chosen)

    @property
    def subset(self) -> SampleTable:
        """The chosen rows."""
        return self.rows.take(self.chosen)

    def trial_of(self) -> Indices:
        """Return the trial index of every row, shape (n,)."""
        return np.repeat(np.arange(len(self.lengths)), self.lengths)
