"""How far probabilities are from the shares that come true."""

import numpy as np

from analysis.data.series import Array, Indices

BINS = 10


def equal_bins(p: Array) -> list[Indices]:
    """Return the rows of ten bins of equally many, by rising probability."""
    return np.array_split(np.argsort(p, kind="stable"), BINS)


def calibration_error(
    p: Array, truth: np.ndarray, weight: Array | None = None
) -> float:
    """Return the mean difference of probability and share over ten bins.

    Args:
        p: probabilities, shape (n,).
        truth: what happened, shape (n,).
        weight: of every row; None = alike, and the bins hold equal numbers of rows.
    """
    if not p.size:
        return float("nan")
    if weight is None:
        off = [abs(float((p[rows] - truth[rows]).sum())) for rows in equal_bins(p)]
        return sum(off) / p.size
    bin_index = np.minimum((p * BINS).astype(int), BINS - 1)
    total = np.bincount(bin_index, weight * (p - truth), BINS)
    return float(np.abs(total).sum() / weight.sum())
