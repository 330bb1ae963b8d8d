"""The functions for notebooks, and the example that docs/functions.md gives of them."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.api import (
    BreakAwayOptions,
    FitOptions,
    crossvalidate,
    fit_break_away,
    fit_gp,
    fit_tustin,
    load_terrains,
    prepare,
)
from analysis.terrains.export import database_of

PAGE = Path(__file__).parents[2] / "docs" / "functions.md"
SMALL = FitOptions(gp_points=60, models=("tustin", "gp_se"))


@pytest.fixture(scope="module")
def kept(slice_trials):
    return [prepare(series) for series in slice_trials["TF"]]


def test_the_example_of_the_page_runs_on_a_table(
    slice_path, tmp_path, monkeypatch, capsys
):
    (block,) = [
        block
        for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
        if "analysis.api" in block
    ]
    (tmp_path / "trials.npz").symlink_to(slice_path)
    monkeypatch.chdir(tmp_path)
    exec(compile(block, str(PAGE), "exec"), {})
    said = capsys.readouterr().out.splitlines()
    assert "'mu'" in said[0]
    assert [line[0] for line in said[-3:]] == ["1", "2", "3"]


def test_models_of_a_plate_follow_its_samples(kept):
    for model in (fit_tustin(kept), fit_gp(kept, options=SMALL)):
        answer = model.predict(kept[0].F_n, kept[0].v_t)
        error = np.abs(answer.mean - kept[0].F_t).mean()
        # a constant's error is 0.7 N on this plate
        assert error < 0.5
        assert (answer.sd > 0).all()


def test_folds_are_those_of_a_study(kept, small_study):
    folds = crossvalidate({"TF": kept}, SMALL, n_jobs=1)
    expected = small_study.terrains["TF"].maes("gp_se")
    found = [fold.models["gp_se"].score.mae for fold in folds]
    assert found == pytest.approx(expected, rel=1e-9)


def test_forces_from_rest_are_those_of_the_kinds_that_are_given(slice_trials):
    trials = {
        name: [prepare(series) for series in slice_trials[name]]
        for name in ("S0", "B0")
    }
    few = BreakAwayOptions(draws=10)
    stones = fit_break_away(trials, options=few)
    assert stones["S0"].law.spread == stones["B0"].law.spread
    plates = fit_break_away(trials, dict.fromkeys(trials, "flat"), few)
    assert plates["S0"].law.spread != plates["B0"].law.spread
    answer = stones["S0"].available(3.5, 0.1)
    assert stones["S0"].slip_risk(answer.force, 3.5).risk == pytest.approx(0.1)


def test_a_terrain_database_answers_from_rest_and_in_motion(small_study, tmp_path):
    fit = replace(small_study.options.fit, models=("tustin",))
    study = replace(small_study, options=replace(small_study.options, fit=fit))
    path = tmp_path / "terrains.json"
    path.write_text(database_of(study, None, "2027-01-15T08:00:00Z", 1))
    known = load_terrains(path).terrain("S0")
    assert known.slip_risk(6.0, 3.5).kind == "break-away"
    assert known.risk_in_motion(6.0, 3.5).kind == "in motion"


def test_a_model_that_does_not_exist_is_refused_with_the_list(kept):
    with pytest.raises(SettingsError, match="no model 'gp'") as refused:
        fit_gp(kept, "gp")
    assert "gp_se_tustin" in refused.value.hint
