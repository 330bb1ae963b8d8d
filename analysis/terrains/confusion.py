"""How often one kind was taken for another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Confusion:
    """How often a window of one kind was taken for which.

    Attributes:
        names: kinds, m of them.
        counts: windows, rows the truth, columns the answer, shape (m, m).
    """

    names: tuple[str, ...]
    counts: np.ndarray

    @property
    def accuracy(self) -> float:
        """Mean over the kinds of the share that was recognised; NaN without windows."""
        totals = self.counts.sum(axis=1)
        present = totals > 0
        if not present.any():
            return float("nan")
        return float((self.counts.diagonal()[present] / totals[present]).mean())


def confusion_of(pairs: Sequence[tuple[str, str]]) -> Confusion:
    """Return how often each truth got each answer, by (truth, answer) pairs."""
    names = tuple(
        dict.fromkeys(name for pair in zip(*pairs, strict=True) for name in pair)
    )
    counts = np.zeros((len(names), len(names)), np.int64)
    for truth, answer in pairs:
        counts[names.index(truth), names.index(answer)] += 1
    return Confusion(names, counts)
