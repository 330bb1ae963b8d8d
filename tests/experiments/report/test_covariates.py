"""A covariate that cannot be used is reported by the command."""

import pytest

from tests.experiments.program import traction

HEADER = "t,v_t,F_n,F_t,temp\n"


@pytest.fixture
def tables(tmp_path):
    """Two short tables with an additional column."""
    paths = [tmp_path / f"T{k}.csv" for k in range(2)]
    for k, path in enumerate(paths):
        rows = (
            f"{i * 0.002:.3f},{0.02 + 0.001 * (i % 40):.4f},{3 + (i % 7) * 0.1:.2f},"
            f"{1.5 + 0.01 * (i % (13 + k)):.3f},{20 + k}\n"
            for i in range(600)
        )
        path.write_text(HEADER + "".join(rows))
    return paths


@pytest.mark.slow
def test_a_column_that_cannot_be_tested_is_reported_with_the_cause(tables, tmp_path):
    to = ("--to", tmp_path / "fit", "--models", "tustin", "--covariate", "temp")
    done = traction("fit", *tables, *to)
    assert done.code == 0, done.err
    assert "temp: not tested (2 trials with samples, it takes 3)." in done.out


def test_a_missing_column_is_reported_with_the_option(tables, tmp_path):
    done = traction("fit", *tables, "--to", tmp_path / "fit", "--covariate", "wet")
    assert done.code == 2
    assert "no column wet" in done.err
    assert "--covariate NAME" in done.err
