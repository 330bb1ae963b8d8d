"""`--models` selects the models that a report fits and shows."""

import json
from pathlib import Path

import pytest

from tests.experiments.program import traction

SLICE = Path(__file__).parents[2] / "data" / "rehearsal_slice.npz"


@pytest.mark.slow
def test_only_the_named_models_are_fitted_and_shown(tmp_path):
    done = traction("fit", SLICE, "--to", tmp_path / "fit", "--models", "tustin,gp_nn")
    assert done.code == 0, done.err
    fits = json.loads((tmp_path / "fit" / "fits.json").read_text())
    assert fits["options"]["fit"]["models"] == ["tustin", "gp_nn"]
    assert set(fits["terrains"]["TF"]["mae"]) == {"tustin", "gp_nn"}
    page = (tmp_path / "fit" / "report" / "index.html").read_text()
    assert "GP (NN) MAE" in page
    assert "GP (SE) MAE" not in page


@pytest.mark.parametrize("text", ["", "best", "tustin,tustin", "gp_se best"])
def test_unknown_models_are_refused_with_the_list(tmp_path, text):
    done = traction("fit", SLICE, "--to", tmp_path / "fit", "--models", text)
    assert done.code == 2
    assert "--models" in done.err
    assert "gp_se_tustin" in done.err
    assert not (tmp_path / "fit").exists()
