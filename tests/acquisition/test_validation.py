"""Hostile files give few problems, and the first one is reported with its location."""

import json

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

from acquisition.errors import SettingsError
from acquisition.validation import Entries, Many, first_problem
from analysis.tables.data_package import DataPackage
from analysis.terrains.database import load
from tests.corpus.samples import samples


class Row(BaseModel):
    size: int


class Rows(BaseModel):
    rows: Many[Row]
    named: Entries[str, Row]


def problem(content):
    with pytest.raises(ValidationError) as caught:
        Rows.model_validate(content)
    return caught.value


def test_a_list_is_checked_up_to_its_first_wrong_value():
    assert problem({"rows": [1] * 1000, "named": {}}).error_count() == 1


def test_values_of_a_table_with_too_many_keys_are_not_checked():
    error = problem({"rows": [], "named": {str(k): 1 for k in range(201)}})
    assert error.error_count() == 1
    assert first_problem(error) == "named: 201 entries, the most are 200"


def test_a_table_with_as_many_keys_as_allowed_is_accepted():
    named = {str(k): {"size": k} for k in range(200)}
    assert len(Rows.model_validate({"rows": [], "named": named}).named) == 200


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"named": {}}, "rows is missing"),
        ({"rows": [{"size": 1}, {}], "named": {}}, "rows.1.size is missing"),
        ({"rows": [3], "named": {}}, "rows.0: Input should be a table"),
        ({"rows": [], "named": {"\x1b[2J": 1}}, "named.'\\x1b[2J': Input should be a"),
        ({"rows": [], "named": {"x" * 999: 1}}, f"named.{'x' * 60}: Input should be"),
    ],
)
def test_the_first_problem_is_reported_with_its_location(content, words):
    assert first_problem(problem(content)).startswith(words)


def test_the_message_of_another_check_is_passed_on():
    assert first_problem(ValueError("3 poses")) == "3 poses"
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(int).validate_python("x")
    assert first_problem(caught.value).startswith("Input should be a valid integer")


def test_a_package_of_many_wrong_files_has_one_problem():
    text = json.dumps({"name": "p", "resources": [1] * 1_000_000})
    with pytest.raises(ValidationError) as caught:
        DataPackage.model_validate_json(text)
    assert caught.value.error_count() == 1


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("shares",), ["a"] * 1000),
        (("axes", "F_n"), ["a"] * 1000),
        (("terrains",), {str(k): 1 for k in range(1000)}),
        (("terrains", "S0", "limits"), {str(k): "a" for k in range(1000)}),
        (("terrains", "S0", "models"), {str(k): 1 for k in range(1000)}),
        (("terrains", "S0", "models", "gp", "quantiles"), [["a"] * 1000] * 1000),
        (("terrains", "S0", "break_away", "draws"), [1] * 1000),
        (("terrains", "S0", "roughness"), {str(k): "a" for k in range(1000)}),
    ],
)
def test_a_database_of_many_wrong_values_has_few_problems(tmp_path, keys, value):
    content = json.loads(samples()["database"])
    parent = content
    for key in keys[:-1]:
        parent = parent[key]
    parent[keys[-1]] = value
    path = tmp_path / "terrains.json"
    path.write_text(json.dumps(content))
    with pytest.raises(SettingsError, match="not a terrain database") as caught:
        load(path)
    cause = caught.value.__cause__
    assert isinstance(cause, ValidationError)
    assert cause.error_count() <= 2  # a value and the length
