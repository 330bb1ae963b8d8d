"""Soil for SCM: what is identified comes back, the rest is absent with a reason."""

import json
from dataclasses import replace
from math import atan, degrees

import numpy as np
import pytest

from analysis.breakaway.model import PushLaw
from analysis.exports.targets.chrono import soil_of
from analysis.terrains.parts import BREAK_AWAY_PART
from tests.analysis.exports.databases import export, from_rest
from tests.analysis.exports.written import write

SCM = {
    "Bekker_Kphi", "Bekker_Kc", "Bekker_n", "Mohr_cohesion", "Mohr_friction",
    "Janosi_shear", "elastic_K", "damping_R",
}  # fmt: skip


def soil(kind="TF", area=0.002, **changes):
    """Return the soil of a terrain whose law from rest is changed."""
    terrain = export().terrains[0]
    parts = {BREAK_AWAY_PART: replace(from_rest(kind), **changes).to_dict()}
    return soil_of(replace(terrain, known=replace(terrain.known, parts=parts)), area)


def test_a_line_through_forces_comes_back():
    """A law that is linear in F_n has its slope as tan phi, its level as c A."""
    made = soil(law=PushLaw(0.5, 0.8, 0.2, 0.1))["identified"]
    phi, c = made["Mohr_friction"], made["Mohr_cohesion"]
    assert phi["value"] == pytest.approx(degrees(atan(0.8)), rel=1e-3)
    assert c["value"] == pytest.approx(0.5 / 0.002, rel=1e-3)
    for each in (phi, c):
        assert each["low"] < each["value"] < each["high"]


def test_every_parameter_is_identified_or_absent_with_a_reason():
    for made in (soil(), soil("S0"), soil(area=None), soil(loads=(3.0, 3.5))):
        assert set(made["identified"]) | set(made["absent"]) == SCM
        assert not set(made["identified"]) & set(made["absent"])
        assert all(len(reason) > 10 for reason in made["absent"].values())
    assert {"Mohr_friction", "Mohr_cohesion"} <= set(soil(loads=(3.0, 3.5))["absent"])
    assert "--sole-area" in soil(area=None)["absent"]["Mohr_cohesion"]


def test_a_line_below_the_origin_is_no_cohesion():
    draws = np.tile([-1.0, 0.8, 0.2, 0.1], (60, 1))
    made = soil(law=PushLaw(-1.0, 0.8, 0.2, 0.1), draws=draws, loads=(3.0, 8.0))
    assert "Mohr_cohesion" in made["absent"]
    assert "Mohr_friction" in made["identified"]


def test_a_terrain_that_was_not_pushed_from_rest_has_no_strength():
    terrain = export().terrains[0]
    bare = replace(terrain, known=replace(terrain.known, parts={}))
    assert soil_of(bare, 0.002)["identified"] == {}


def test_the_file_says_simulated(tmp_path):
    content = json.loads((write(tmp_path, "chrono") / "soil.json").read_text())
    assert content["simulated"] is True
    assert set(content["terrains"]) == {"S0", "TF"}
