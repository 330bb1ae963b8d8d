"""The functions for notebooks, and the example that the README gives of them."""

import re
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.api import FitOptions, crossvalidate, fit_gp, fit_tustin, prepare

README = Path(__file__).parents[2] / "README.md"
SMALL = FitOptions(gp_points=60, models=("tustin", "gp_se"))


@pytest.fixture(scope="module")
def kept(slice_trials):
    return [prepare(series) for series in slice_trials["TF"]]


def test_the_readmes_example_runs_on_a_table(slice_path, tmp_path, monkeypatch, capsys):
    (block,) = [
        block
        for block in re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
        if "analysis.api" in block
    ]
    (tmp_path / "trials.npz").symlink_to(slice_path)
    monkeypatch.chdir(tmp_path)
    exec(compile(block, str(README), "exec"), {})
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


def test_a_model_that_does_not_exist_is_refused_with_the_list(kept):
    with pytest.raises(SettingsError, match="no model 'gp'") as refused:
        fit_gp(kept, "gp")
    assert "gp_se_tustin" in refused.value.hint
