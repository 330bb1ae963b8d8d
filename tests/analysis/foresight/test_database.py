"""Foresight in the file of a terrain database, and files from before it."""

import json
import re

import pytest

from acquisition.errors import SettingsError
from analysis.terrains.database import load, to_text
from analysis.terrains.parts import foresight_in
from tests.analysis.foresight.databases import database, write_database
from tests.analysis.foresight.made import model


def saved(tmp_path, text):
    path = tmp_path / "terrains.json"
    path.write_text(text)
    return path


def test_what_was_learnt_is_read_back_bit_for_bit(tmp_path):
    path = write_database(tmp_path / "terrains.json")
    assert foresight_in(load(path).parts) == model()


def test_a_file_from_before_foresight_is_read_and_knows_none(tmp_path):
    read = load(saved(tmp_path, database()))
    assert foresight_in(read.parts) is None
    assert set(read.terrains) == {"S10", "TF"}


def test_a_file_without_any_parts_is_read_and_knows_none(tmp_path):
    content = json.loads(database())
    del content["parts"]
    assert foresight_in(load(saved(tmp_path, json.dumps(content))).parts) is None


def test_foresight_survives_a_file_that_is_written_back(tmp_path):
    path = write_database(tmp_path / "terrains.json")
    again = saved(tmp_path, to_text(load(path)))
    assert foresight_in(load(again).parts) == model()


def with_part(**part):
    """Return what was learnt with one of its parts replaced."""
    return lambda: model().to_dict() | part


@pytest.mark.parametrize(
    "foresight",
    [
        list,
        lambda: "text",
        lambda: 7,
        dict,
        lambda: {"version": 99},
        with_part(laws=3),
        with_part(provenance={"rigs": [3], "trials": [], "seeds": []}),
        with_part(slip=[1]),
        with_part(surfaces={"x": {}}),
    ],
)
def test_a_file_with_impossible_foresight_is_refused(tmp_path, foresight):
    path = saved(tmp_path, database(foresight()))
    with pytest.raises(SettingsError, match=re.escape("not a terrain database")):
        load(path)
