"""Cells and crosses of matrix.toml give rows; a wrong entry is named with its cause."""

import pytest

from acquisition.errors import SettingsError
from experiments.settings.load import load_settings

FACTORS = """version = "1.0"
[[factors]]
name = "d50"
unit = "mm"
kind = "number"
scale = "log"
[[factors]]
name = "moisture"
kind = "word"
levels = ["dry", "wet"]
"""
CELL = """[[cells]]
name = "G19"
foot = "tread"
d50 = 19
moisture = "dry"
place = "bay"
"""
PLACE = """
[places.bay]
far_end = [0.7, 0.0, 0.12]
travel = 0.45
incline_deg = 0.0
"""
CROSS = """[[crosses]]
name = "G{d50:02.0f}{moisture:.1}{foot:.1}{incline_deg:+d}"
foot = ["tread", "bare"]
d50 = [12, 37]
moisture = ["dry", "wet"]
incline_deg = [-2, 0, 2]
place = "bay"
"""


@pytest.fixture
def load(tmp_path):
    shipped = load_settings(None)

    def settings(matrix, rig=PLACE):
        (tmp_path / "rig.toml").write_text(shipped.rig_text + rig)
        (tmp_path / "matrix.toml").write_text(matrix)
        return load_settings(tmp_path / "rig.toml")

    return settings


def test_a_cell_takes_its_numbers_from_its_place(load):
    (row,) = load(FACTORS + CELL).matrix.terrains
    assert (row.far_end, row.travel, row.place) == ((0.7, 0.0, 0.12), 0.45, "bay")
    assert (row.stones, row.kind) == ("small", "small")
    assert row.factors == {"d50": 19.0, "moisture": "dry"}
    assert (row.start_q, row.push_deg, row.trials) == (None, 0, 10)


@pytest.mark.parametrize(
    ("d50", "stones", "kind"),
    [
        ("37", "big", "big"),
        ("12.5", "12.5 mm", "12.5 mm"),
        ("0.5", "fine", "fine"),
        ('"-"', "none", "flat"),
    ],
)
def test_the_ground_follows_from_the_grain_size(load, d50, stones, kind):
    (row,) = load(FACTORS + CELL.replace("d50 = 19", f"d50 = {d50}")).matrix.terrains
    assert (row.stones, row.kind) == (stones, kind)


def test_a_cross_is_every_combination(load):
    matrix = load(FACTORS + CROSS).matrix
    names = [row.name for row in matrix.terrains]
    assert len(names) == len(set(names)) == 24
    assert names[0] == "G12dt-2"
    assert names[-1] == "G37wb+2"
    assert matrix.terrains[-1].incline_deg == 2.0


def test_a_name_may_hold_a_decimal_number(load):
    text = changed("{d50:02.0f}", "{d50:g}", CROSS).replace("[12, 37]", "[12.5, 37]")
    assert load(FACTORS + text).matrix.terrains[0].name == "G12.5dt-2"


def test_effects_of_words_are_passed_to_the_simulation(load):
    effects = "[simulate.moisture.wet]\ns_inf = 0.8\nk_w = 1.2\n"
    wet = CELL.replace("dry", "wet").replace("G19", "W19")
    dry, other = load(FACTORS + effects + CELL + wet).matrix.terrains
    assert (dry.simulate, other.simulate) == ({}, {"s_inf": 0.8, "k_w": 1.2})


def changed(old, new, text=FACTORS + CELL):
    assert old in text
    return text.replace(old, new)


REFUSED = {
    "missing factor": (
        changed('moisture = "dry"\n', ""),
        'G19 does not state moisture; write moisture = "-"',
    ),
    "unknown word": (
        changed('moisture = "dry"', 'moisture = "damp"'),
        "G19: moisture = 'damp' - expected one of dry, wet",
    ),
    "not a number": (changed("d50 = 19", 'd50 = "big"'), "expected a finite number"),
    "not above 0": (changed("d50 = 19", "d50 = 0"), "expected a number above 0"),
    "misspelt key": (
        changed("moisture =", "moistur =", CELL).join([FACTORS, ""]),
        "moistur is neither a setting of a cell nor a factor - did you mean moisture?",
    ),
    "two numbers joined": (
        FACTORS
        + changed("{moisture:.1}{foot:.1}{incline_deg:+d}", "{incline_deg:d}", CROSS),
        "joins two numbers without a mark between",
    ),
    "name twice": (FACTORS + CELL + CELL, "name 'G19' occurs twice (line 17)"),
    "factor twice": (
        changed('name = "moisture"', 'name = "d50"').replace(
            'kind = "word"\nlevels = ["dry", "wet"]', 'kind = "number"\nunit = "mm"'
        ),
        "factor d50 occurs twice",
    ),
    "reserved name": (changed('"moisture"', '"foot"'), "that Traction itself uses"),
    "word without levels": (changed('levels = ["dry", "wet"]\n', ""), "needs levels"),
    "d50 in metres": (changed('unit = "mm"', 'unit = "m"'), "d50 is the grain size"),
    "no such place": (changed('"bay"', '"pit"'), "Teach it: traction teach pit"),
    "two places": (
        changed('place = "bay"', 'place = "bay"\nfar_end = [0.6, 0.0, 0.1]'),
        "states both place and far_end",
    ),
    "no place": (changed('place = "bay"\n', ""), "states no place"),
    "another incline": (
        changed('place = "bay"', 'place = "bay"\nincline_deg = 10'),
        "but place bay stands at 0 degrees",
    ),
    "no such foot": (changed('"tread"', '"claw"'), "expected one of rig.toml: tread"),
    "too steep": (
        changed('place = "bay"', 'place = "bay"\nincline_deg = 45'),
        "incline_deg = 45 - expected a number >= -30 and <= 30 degrees",
    ),
    "push across": (
        changed('place = "bay"', 'place = "bay"\npush_deg = 90'),
        "cells[0].push_deg = 90",
    ),
    "no cells": (FACTORS, "there are no [[cells]]"),
    "no ground": (
        'version = "1.0"\n[[cells]]\nname = "A"\nfoot = "tread"\nplace = "bay"\n',
        'needs ground = "stones", "plate" or "fine"',
    ),
    "too many": (
        FACTORS + CROSS.replace("[12, 37]", str(list(range(10, 60)))),
        "more than 400 cells",
    ),
    "equal names": (
        FACTORS + CROSS.replace("{incline_deg:+d}", ""),
        "name every factor of the cross",
    ),
    "wide format": (FACTORS + CROSS.replace("02.0f", "9999f"), "odd form '9999f'"),
    "attribute": (FACTORS + CROSS.replace("{foot:.1}", "{foot.real}"), "odd brace"),
    "long name": (
        FACTORS + CROSS.replace('"G{', '"' + 20 * "G" + "{"),
        "crosses[0].name",
    ),
    "empty list": (FACTORS + CROSS.replace("[12, 37]", "[]"), "d50 is an empty list"),
    "effect of an unknown word": (
        FACTORS + "[simulate.moisture.damp]\nk_w = 2\n" + CELL,
        "simulate.moisture.damp is no word of a factor",
    ),
    "effect on an unknown quantity": (
        FACTORS + "[simulate.moisture.wet]\nhope = 2\n" + CELL,
        "simulate.moisture.wet.hope",
    ),
    "block by an unknown factor": (
        FACTORS + '[design]\norder = "blocked"\nblock_by = ["hope"]\n' + CELL,
        "block_by names 'hope'",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_wrong_matrix_is_refused_with_its_cause(load, name):
    text, cause = REFUSED[name]
    with pytest.raises(SettingsError) as raised:
        load(text)
    assert cause in raised.value.message
    assert raised.value.message.startswith("matrix.toml: ")


def test_further_feet_are_read_and_checked(load):
    foot = """
[feet.round]
mass = 0.4
com = [0.01, 0.0, 0.06]
inertia = [4e-4, 5e-4, 4e-4]
sole = [0.01, 0.0, 0.1]
shape = "round"
"""
    settings = load(FACTORS + changed('"tread"', '"round"', CELL), PLACE + foot)
    assert settings.rig.feet["round"].shape == "round"
    assert list(settings.rig.feet) == ["tread", "bare", "round"]
    wrong = PLACE + foot.replace("mass = 0.4", "mass = 400")
    with pytest.raises(SettingsError, match=r"feet.round.mass = 400 .* is it in g\?"):
        load(FACTORS + CELL, wrong)
