"""Tables of terrains whose forces are normal."""

from analysis.study.distribution import SHARES, normal_scores
from analysis.terrains.table import Table, rows_of


def normal_table(F_n, v_t, mean, sd):
    """Return the quantiles of normal distributions, mean and sd of shape (n, m)."""
    forces = [mean + score * sd for score in normal_scores(SHARES)]
    return Table(F_n, v_t, SHARES, tuple(rows_of(values) for values in forces))
