"""Forces from rest are written to a terrain database, read back or refused."""

import json
from dataclasses import replace

import pytest

from acquisition.errors import SettingsError
from analysis.study.models import TUSTIN
from analysis.terrains.database import load
from analysis.terrains.tabulation import database_of


@pytest.fixture(scope="module")
def fitted(small_study):
    return small_study.break_away


@pytest.fixture(scope="module")
def path(small_study, tmp_path_factory):
    fit = replace(small_study.options.fit, models=(TUSTIN,))
    study = replace(small_study, options=replace(small_study.options, fit=fit))
    path = tmp_path_factory.mktemp("db") / "terrains.json"
    path.write_text(database_of(study, None, "2027-01-15T08:00:00Z", 1))
    return path


def changed(path, tmp_path, change):
    """Return the database with every terrain changed by a function."""
    content = json.loads(path.read_text())
    for terrain in content["terrains"].values():
        change(terrain)
    file = tmp_path / "changed.json"
    file.write_text(json.dumps(content))
    return file


@pytest.mark.parametrize("name", ["S0", "B0", "TF"])
def test_answers_from_rest_agree_with_the_fit(fitted, path, name):
    known = load(path).terrain(name)
    here, there = known.slip_risk(4.0, 3.5), fitted[name].slip_risk(4.0, 3.5)
    assert here.risk == pytest.approx(there.risk, abs=1e-4)
    assert (here.low, here.high) == pytest.approx((there.low, there.high), abs=1e-4)
    assert (here.kind, here.slips, here.held, here.v_slip) == (
        there.kind,
        there.slips,
        there.held,
        there.v_slip,
    )


def test_stones_have_a_break_away_model_and_a_smooth_plate_has_sliding(fitted, path):
    database = load(path)
    kinds = {name: database.terrain(name).slip_risk(4.0, 3.5).kind for name in fitted}
    assert kinds == {"S0": "break-away", "B0": "break-away", "TF": "sliding"}


def test_the_available_force_has_the_requested_risk(path):
    known = load(path).terrain("S0")
    force = known.from_rest.available(3.5, 0.1).force
    assert known.slip_risk(force, 3.5).risk == pytest.approx(0.1, abs=1e-6)


def test_a_moving_foot_has_less_force_than_one_at_rest(path):
    known = load(path).terrain("S0")
    assert known.risk_in_motion(6.0, 3.5) > 1.5 * known.slip_risk(6.0, 3.5).risk


def test_terrain_without_pushes_answers_only_in_motion(path, tmp_path):
    old = changed(path, tmp_path, lambda terrain: terrain.pop("break_away"))
    known = load(old).terrain("TF")
    assert 0.0 < known.risk_in_motion(2.6, 3.5) < 1.0
    with pytest.raises(SettingsError, match="not known"):
        known.slip_risk(2.6, 3.5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"law": [1.0, 1.0, -1.0, 0.0]}, "law.2: Input should be greater"),
        ({"kind": "magic"}, "kind: Input should be 'break-away'"),
        ({"v_slip": float("inf")}, "v_slip: Input should be a finite"),
        ({"draws": 3}, "not a terrain database: .*draws: "),
    ],
)
def test_a_damaged_break_away_model_is_refused(path, tmp_path, change, words):
    bad = changed(path, tmp_path, lambda terrain: terrain["break_away"].update(change))
    with pytest.raises(SettingsError, match=words):
        load(bad)
