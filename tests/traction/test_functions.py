"""The functions of the package on tables, and the example of docs/notebook.md."""

import re
from pathlib import Path

import numpy as np
import pytest

import traction as tr
from analysis.study.break_away_fit import BreakAwayOptions
from analysis.study.models import FitOptions

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "notebook.md"
SLICE = ROOT / "tests" / "data" / "rehearsal_slice.npz"
SMALL = FitOptions(gp_points=60)


@pytest.fixture(scope="module")
def tables():
    return tr.load_tables(SLICE)


@pytest.mark.slow
def test_the_example_of_the_page_runs_on_a_table(tmp_path, monkeypatch, capsys):
    block = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)[1]
    (tmp_path / "trials.npz").symlink_to(SLICE)
    monkeypatch.chdir(tmp_path)
    exec(compile(block, str(PAGE), "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert "'mu'" in lines[0]
    assert [line[0] for line in lines[-3:]] == ["1", "2", "3"]


@pytest.mark.parametrize("model", ["tustin", "gp_se"])
def test_models_of_a_plate_follow_its_samples(tables, model):
    plate = tables.on("TF")
    kept = plate[0].kept
    answer = tr.fit(plate, model, SMALL).predict(kept.F_n, kept.v_t)
    error = np.abs(answer.mean - kept.F_t).mean()
    # a constant's error is 0.7 N on this plate
    assert error < 0.5
    assert (answer.sd > 0).all()


def test_break_away_models_depend_on_the_given_kinds_of_ground(tables):
    trials = [*tables.on("S0"), *tables.on("B0")]
    few = BreakAwayOptions(draws=10)
    stones = tr.fit_break_away(trials, options=few)
    assert stones["S0"].law.spread == stones["B0"].law.spread
    plates = tr.fit_break_away(trials, dict.fromkeys(("S0", "B0"), "flat"), few)
    assert plates["S0"].law.spread != plates["B0"].law.spread
    answer = stones["S0"].available(3.5, 0.1)
    assert stones["S0"].slip_risk(answer.force, 3.5).risk == pytest.approx(0.1)
