"""Trials from tables are refused before any fit if a column has the wrong sign."""

import pytest

from tests.experiments.program import traction


def table(path, normal_force):
    rows = [f"{k * 0.002:.3f},0.05,{normal_force},1.0" for k in range(600)]
    path.write_text("\n".join(["t [s],v_t [m/s],F_n [N],F_t [N]", *rows]) + "\n")
    return path


def test_a_negative_normal_force_is_refused_with_the_option(tmp_path):
    done = traction("fit", table(tmp_path / "a.csv", -5.0), "--to", tmp_path / "report")
    assert done.code == 2
    assert "F_n is negative in 100% of the rows" in done.err
    assert "--negate F_n" in done.err
    assert not (tmp_path / "report").exists()


@pytest.mark.slow
def test_the_option_turns_the_sign(tmp_path):
    path, to = table(tmp_path / "a.csv", -5.0), tmp_path / "report"
    done = traction("fit", path, "--to", to, "--negate", "F_n", "--models", "tustin")
    assert done.code == 0, done.err
