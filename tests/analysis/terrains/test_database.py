"""The file of a terrain database keeps its version, its schema and its content."""

import json
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest

import analysis.terrains
from acquisition.errors import SettingsError
from analysis.study.distribution import SHARES
from analysis.terrains.classifier import SurfaceClassifier
from analysis.terrains.database import load, to_text
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.logistic import RidgeLogistic
from analysis.terrains.path_copula import PathCopula
from analysis.terrains.table import Table, rows_of
from analysis.terrains.windows import FEATURES
from tests.analysis.terrains.export.databases import from_rest
from tests.analysis.terrains.tables import normal_table

UTC = "2027-01-15T08:00:00Z"
MEAN, SD = [[1.0, 2.0], [3.0, 5.0]], [[0.5, 0.5], [1.0, 2.0]]
SCHEMA = Path(analysis.terrains.__file__).parent / "terrain_db.schema.json"


_ONES = (1.0,) * len(FEATURES)
SURFACES = SurfaceClassifier({50: RidgeLogistic(_ONES, _ONES, (0.0, *_ONES, *_ONES))})


def saved(tmp_path, content):
    path = tmp_path / "terrains.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def skewed(**more):
    """Return a database of one terrain with a lognormal force."""
    scores = [NormalDist().inv_cdf(share) for share in SHARES]
    middle = np.array(MEAN)
    forces = [np.exp(0.4 * score) * middle for score in scores]
    table = Table((1.0, 5.0), (0.01, 0.2), SHARES, tuple(map(rows_of, forces)))
    terrain = KnownTerrain(
        "S0", "small", 10, 9000, 0.9, {100: 3.0}, {"gp_se_trial": table},
        {"gp_se_trial": {"c": 3.0}}, "gp_se_trial", {"gp_se_trial": "new trial"},
        "gp_se_trial", **more,
    )  # fmt: skip
    return TerrainDatabase({"S0": terrain}, True, UTC)


def test_a_written_database_is_read_back(tmp_path):
    database = skewed()
    again = load(saved(tmp_path, to_text(database)))
    assert again.made_utc == UTC
    assert again.is_simulated
    first, second = (d.terrain("S0").predict(3.0, 0.1) for d in (database, again))
    assert second.forces == pytest.approx(first.forces, rel=1e-4)
    assert again.terrain("S0").parameters == {"gp_se_trial": {"c": 3.0}}
    assert again.terrain("S0").copula is None


def test_a_copula_is_kept_and_bounded(tmp_path):
    copula = PathCopula(0.25, 1.5, 0.2)
    known = skewed(copula=copula)
    assert load(saved(tmp_path, to_text(known))).terrain("S0").copula == copula
    content = json.loads(to_text(known))
    content["terrains"]["S0"]["copula"]["tau_stick"] = 0.0
    with pytest.raises(SettingsError, match="tau_stick"):
        load(saved(tmp_path, content))
    del content["terrains"]["S0"]["copula"]  # as in older files
    assert load(saved(tmp_path, content)).terrain("S0").copula is None


def test_factors_and_incline_are_kept_and_bounded(tmp_path):
    content = json.loads(to_text(skewed()))
    content["terrains"]["S0"] |= {
        "incline_deg": -10.0,
        "factors": {"d50": 12, "moisture": "wet", "load": None, "odd": [1], "n": 1e99},
    }
    known = load(saved(tmp_path, content)).terrain("S0")
    assert known.incline_deg == -10.0
    assert known.factors == {"d50": 12.0, "moisture": "wet", "load": None}
    again = json.loads(to_text(load(saved(tmp_path, content))))["terrains"]["S0"]
    assert again["factors"] == dict(known.factors)


@pytest.mark.parametrize("version", [1, 2, 3, "0.9", None, [1.0] * 99])
def test_a_file_of_another_version_is_refused_by_version(tmp_path, version):
    with pytest.raises(SettingsError) as refused:
        load(saved(tmp_path, changed(version=version)))
    shown = f"version: it is {version!r:.20}, and only 1.0 is read."
    assert shown in str(refused.value)


def test_a_skewed_force_keeps_its_skew():
    answer = skewed().terrain("S0").predict(1.0, 0.01)
    low, high = (answer.quantile(share) for share in (0.05, 0.95))
    assert high - answer.median > 1.5 * (answer.median - low)
    assert answer.mean > answer.median
    # linear between nine shares: within a few percent of the lognormal's moments
    assert answer.mean == pytest.approx(np.exp(0.08), rel=0.03)


def test_risk_and_quantile_are_inverse():
    terrain = skewed().terrain("S0")
    answer = terrain.predict(3.0, 0.1)
    for share in (0.005, 0.02, 0.3, 0.8, 0.995):
        force = answer.quantile(share)
        assert terrain.risk_in_motion(force, 3.0, 0.1) == pytest.approx(share, rel=1e-6)


def test_the_file_is_read_without_this_project(tmp_path):
    """With json and arithmetic only: the 5 % quantile at a point of the table."""
    content = json.loads(to_text(skewed()))
    model = content["terrains"]["S0"]["models"][content["default"]]
    table = model["quantiles"][content["shares"].index(0.05)]
    row, column = content["axes"]["F_n"].index(5.0), content["axes"]["v_t"].index(0.2)
    expected = 5.0 * np.exp(0.4 * NormalDist().inv_cdf(0.05))
    assert table[row][column] == pytest.approx(expected, rel=1e-4)
    assert content["units"]["quantiles"] == "N"


def changed(**changes):
    return json.loads(to_text(skewed())) | changes


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"shares": [0.5, 0.1] + [0.9] * 7}, "shares: it does not increase"),
        ({"shares": [0.0, *SHARES[1:]]}, "shares"),
        ({"shares": [0.1, 0.9]}, "finite numbers"),
        ({"shares": [nan] * 9}, "shares"),
        ({"recogniser": "oracle"}, "lacks the model"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path, changes, word):
    with pytest.raises(SettingsError, match=word):
        load(saved(tmp_path, changed(**changes)))


@pytest.mark.parametrize("value", [inf, -99.0])
def test_quantiles_that_do_not_increase_are_refused(tmp_path, value):
    content = changed()
    model = content["terrains"]["S0"]["models"]["gp_se_trial"]
    model["quantiles"][-1][0][0] = value
    with pytest.raises(SettingsError, match="not a terrain database"):
        load(saved(tmp_path, content))


def test_terrains_of_different_grids_make_no_file():
    one, other = skewed().terrain("S0"), load_other_grid()
    with pytest.raises(SettingsError, match="2 different grids"):
        to_text(TerrainDatabase({"S0": one, "TF": other}, True, UTC))


def load_other_grid():
    table = normal_table((0.0, 1.0), (0.1, 0.2), np.array(MEAN), np.array(SD))
    return KnownTerrain("TF", "flat", 1, 1, 0.0, {}, {"m": table}, {}, "m")


def test_a_file_too_large_to_read_is_not_written():
    with pytest.raises(SettingsError, match="6 MB"):
        to_text(skewed(factors={"remarks": "x" * 6_000_000}))


CHECKED = {
    "$schema", "title", "description", "type", "required", "properties", "const",
    "additionalProperties", "items", "minItems", "maxItems", "minimum", "maximum",
    "maxProperties",
    "exclusiveMinimum", "exclusiveMaximum", "minProperties", "$ref", "$defs",
}  # fmt: skip
KINDS = {
    "object": dict, "array": list, "string": str, "boolean": bool, "integer": int,
    "number": (int, float), "null": type(None),
}  # fmt: skip


def problems(value, schema, root, location="$"):
    """Yield where a value breaks a schema of the keywords above."""
    unknown = set(schema) - CHECKED
    assert not unknown, f"keywords that this check does not know: {unknown}"
    if "$ref" in schema:
        name = schema["$ref"].removeprefix("#/$defs/")
        yield from problems(value, root["$defs"][name], root, location)
    if "const" in schema and value != schema["const"]:
        yield f"{location} is not {schema['const']}"
    stated = schema.get("type", [])
    kinds = tuple(KINDS[k] for k in ([stated] if isinstance(stated, str) else stated))
    if kinds and not any(isinstance(value, kind) for kind in kinds):
        yield f"{location} is no {schema['type']}"
        return
    if isinstance(value, dict):
        yield from (
            f"{location}.{n} is missing"
            for n in schema.get("required", ())
            if n not in value
        )
        others = schema.get("additionalProperties", {})
        for name, item in value.items():
            inner = schema.get("properties", {}).get(name, others)
            yield from problems(item, inner, root, f"{location}.{name}")
    sizes = (("minItems", "maxItems"), ("minProperties", "maxProperties"))
    if isinstance(value, list | dict):
        least, most = sizes[isinstance(value, dict)]
        if not schema.get(least, 0) <= len(value) <= schema.get(most, inf):
            yield f"{location} has {len(value)} entries"
    if isinstance(value, list) and "items" in schema:
        for k, item in enumerate(value):
            yield from problems(item, schema["items"], root, f"{location}[{k}]")
    if isinstance(value, int | float) and (
        value < schema.get("minimum", -inf)
        or value <= schema.get("exclusiveMinimum", -inf)
        or value > schema.get("maximum", inf)
        or value >= schema.get("exclusiveMaximum", inf)
    ):
        yield f"{location} = {value} is out of range"


def broken(content):
    schema = json.loads(SCHEMA.read_text())
    return list(problems(content, schema, schema))


def test_written_files_follow_the_shipped_schema():
    terrain = replace(
        skewed().terrain("S0"),
        roughness={50: -1.5},
        break_away=from_rest("S0"),
        incline_deg=10.0,
    )
    text = to_text(TerrainDatabase({"S0": terrain}, True, UTC, SURFACES))
    assert broken(json.loads(text)) == []
    assert broken(json.loads(to_text(skewed()))) == []


@pytest.mark.parametrize(
    ("changes", "location"),
    [
        ({"version": 1}, "$.version"),
        ({"shares": [0.1, 1.0]}, "$.shares[1]"),
        ({"axes": {"F_n": [1.0, 2.0]}}, "$.axes.v_t"),
        ({"terrains": {}}, "$.terrains"),
        ({"terrains": {"S0": {}}}, "$.terrains.S0.kind"),
        ({"simulated": "yes"}, "$.simulated"),
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(tmp_path, changes, location):
    content = changed(**changes)
    assert any(problem.startswith(location) for problem in broken(content))
    if "simulated" not in changes:  # the reader accepts any truth value
        with pytest.raises(SettingsError):
            load(saved(tmp_path, content))
