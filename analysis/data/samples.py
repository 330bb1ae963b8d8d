"""Samples as models take them: columns, and where one trial ends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array, Indices


def inputs_of(F_n: Array, v_t: Array, further: Array | None = None) -> Array:
    """Return inputs of models side by side, shape (n, 2 + k).

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
        beside = [part.further for part in parts if part.further is not None]
        return cls(
            F_n=np.concatenate([empty, *(part.F_n for part in parts)]),
            v_t=np.concatenate([empty, *(part.v_t for part in parts)]),
            F_t=np.concatenate([empty, *(part.F_t for part in parts)]),
            further=np.concatenate(beside) if beside else None,
        )

    @property
    def count(self) -> int:
        """Number of rows."""
        return int(self.F_t.size)

    def part(self, start: int, end: int) -> "SampleTable":
        """Return the rows from `start` to before `end`, without a copy of them."""
        return SampleTable(  # of a mapped file, in a worker
            np.asarray(self.F_n[start:end]),
            np.asarray(self.v_t[start:end]),
            np.asarray(self.F_t[start:end]),
            None if self.further is None else np.asarray(self.further[start:end]),
        )

    def take(self, indices: Indices) -> "SampleTable":
        """Return the rows at `indices`."""
        further = None if self.further is None else self.further[indices]
        return SampleTable(
            self.F_n[indices], self.v_t[indices], self.F_t[indices], further
        )

    @property
    def inputs(self) -> Array:
        """Return (F_n, v_t) and further inputs side by side, shape (n, 2 + k)."""
        return inputs_of(self.F_n, self.v_t, self.further)


class PooledSamples(NamedTuple):
    """Kept samples of all trials, one trial after the other.

    Attributes:
        table: the samples.
        spans: first row and end of every trial, by terrain and number.
    """

    table: SampleTable
    spans: Mapping[str, Mapping[int, tuple[int, int]]]

    @classmethod
    def of(
        cls,
        trials: Mapping[str, Sequence[PreparedTrial]],
        chosen: Mapping[str, Sequence[int]],
    ) -> "PooledSamples":
        """Return the samples of the trials with the numbers `chosen`, by terrain."""
        names = [(name, k) for name, numbers in chosen.items() for k in numbers]
        ends = np.cumsum([0, *(trials[name][k].kept for name, k in names)]).tolist()
        spans: dict[str, dict[int, tuple[int, int]]] = {name: {} for name in chosen}
        for (name, k), span in zip(names, pairwise(ends), strict=True):
            spans[name][k] = span
        return cls(SampleTable.of([trials[name][k] for name, k in names]), spans)

    def trial(self, terrain: str, number: int) -> SampleTable:
        """Return the samples of one trial, without a copy of them."""
        return self.table.part(*self.spans[terrain][number])

    def digests(self) -> dict[str, dict[int, str]]:
        """Return a hash of the samples of every trial, by terrain and number."""
        return {
            name: {k: _digest(self.trial(name, k)) for k in spans}
            for name, spans in self.spans.items()
        }


def _digest(rows: SampleTable) -> str:
    digest = blake2b(digest_size=16)
    further = [] if rows.further is None else [rows.further]
    for column in (rows.F_n, rows.v_t, rows.F_t, *further):
        digest.update(np.ascontiguousarray(column, dtype="<f8").tobytes())
    return digest.hexdigest()


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

    @classmethod
    def of(
        cls, trials: Sequence[PreparedTrial], points: int, seed: int
    ) -> "TrainingSet":
        """Return all kept samples of `trials`, `points` of them chosen at random."""
        rows = SampleTable.of(trials)
        rng = np.random.default_rng(seed)
        chosen = rng.choice(rows.count, min(points, rows.count), replace=False)
        return cls(rows, tuple(trial.kept for trial in trials), chosen)

    @property
    def subset(self) -> SampleTable:
        """Return the chosen rows."""
        return self.rows.take(self.chosen)

    def trial_of(self) -> Indices:
        """Return the number of the trial of every row, shape (n,)."""
        return np.repeat(np.arange(len(self.lengths)), self.lengths)
