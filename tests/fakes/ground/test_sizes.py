"""Grounds of any grain size, and descriptors that scale their parameters."""

from dataclasses import fields

import pytest

from acquisition.errors import SettingsError
from fakes.ground.stone_sizes import (
    STONES,
    StoneParameters,
    slope_factor,
    stones_of_size,
)
from fakes.ground.terrain import PLATES, GroundChoice, PlateParameters


@pytest.mark.parametrize("name", ["small", "big"])
def test_known_stone_sizes_keep_their_parameters(name):
    known = STONES[name]
    made = stones_of_size(known.d50)
    for field in fields(StoneParameters):
        value = getattr(known, field.name)
        assert getattr(made, field.name) == pytest.approx(value)


@pytest.mark.parametrize("d50", [0.010, 0.026, 0.060])
def test_every_stone_size_gives_a_bed(d50):
    made = stones_of_size(d50)
    assert made.N >= 2
    assert all(getattr(made, field.name) > 0.0 for field in fields(StoneParameters))


def test_parameters_are_interpolated_between_neighbours():
    made = stones_of_size(0.026)
    assert STONES["big"].N < made.N < STONES["small"].N
    assert STONES["small"].cop < made.cop < STONES["big"].cop


@pytest.mark.parametrize("word", ["9 mm", "61 mm", "fine", "stones"])
def test_unsimulated_properties_are_reported(word):
    with pytest.raises(SettingsError, match="not simulated"):
        GroundChoice(word, "tread").bed()


def test_descriptors_scale_the_ground_parameters():
    effects = {"s_inf": 0.5, "mu_s": 2.0}
    bed = GroundChoice("small", "tread", effects=effects).bed()
    assert bed.s_inf == pytest.approx(0.5 * STONES["small"].s_inf)
    assert bed.J0 == STONES["small"].J0
    plate = GroundChoice("none", "tread", effects=effects).plate()
    assert plate.mu_s == pytest.approx(2.0 * PLATES["tread"].mu_s)


def test_a_foot_brings_its_own_friction():
    sole = PlateParameters(0.5, 0.4, 0.02, 1.0)
    assert GroundChoice("none", "round", sole).plate() == sole
    assert GroundChoice("none", "round").plate() == PLATES["tread"]
    assert GroundChoice("none", "bare").plate() == PLATES["bare"]


def test_uphill_is_stronger_than_level_and_downhill_weaker():
    # of the bed alone, without the weight along the slope
    assert slope_factor(0.17) < slope_factor(0.0) < slope_factor(-0.08)
