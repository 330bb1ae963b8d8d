"""The terrain database has the models of recorded terrains and identifies trials."""

import json

import pytest

from analysis.terrains.database import load
from tests.experiments.program import run_short, traction, write_config

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """(data folder, database) of two short terrains, two trials each."""
    folder = tmp_path_factory.mktemp("exported")
    config = write_config(folder)
    for terrain in ("S0", "Tf"):
        assert run_short(config, folder / "data", terrain, 2).code == 0
    path = folder / "terrains.json"
    done = traction("export", "--terrain-db", path, "--data", folder / "data")
    assert done.code == 0, done.err
    return folder / "data", path


def test_every_terrain_has_all_models_and_that_of_a_new_trial(exported):
    database = load(exported[1])
    assert set(database.terrains) == {"S0", "Tf"}
    assert database.is_simulated
    models = database.terrain("Tf").tables
    five = {"tustin", "gp_se", "gp_nn", "gp_se_tustin", "gp_nn_tustin"}
    assert set(models) == five | {"gp_se_trial"}
    assert database.terrain("Tf").default == "gp_se_trial"
    assert 0.1 < database.terrain("Tf").predict(3.0, 0.05).mean < 2.0


def test_a_recorded_trial_is_identified(exported):
    data, path = exported
    (trial,) = data.glob("sessions/*_Tf.fake/trials/T02.mcap")
    done = traction("identify", trial, "--terrain-db", path, "--samples", 50)
    assert done.code == 0, done.err
    assert "0.5 s windows" in done.out
    raw = traction("identify", trial, "--terrain-db", path, "--samples", 50, "--json")
    (answer,) = json.loads(raw.out)
    assert answer["terrain"] == "Tf"
    assert answer["recognition"]["terrains"] == ["S0", "Tf"]
    assert answer["recognition"]["surface"] in {"flat", "rocky", "none"}
    assert all(0.0 < m["rocky"] < 1.0 for m in answer["recognition"]["moments"])
    assert "(rocky 0." in done.out or "(rocky 1." in done.out


def test_a_database_is_never_overwritten(exported):
    data, path = exported
    done = traction("export", "--terrain-db", path, "--data", data)
    assert done.code == 2
    assert "never overwritten" in done.err


@pytest.mark.parametrize("options", [(), ("--to", "x", "--terrain-db", "y")])
def test_an_export_of_no_kind_or_two_kinds_is_refused(options):
    done = traction("export", "S001", *options)
    assert done.code == 2
    assert "Name one of the three" in done.err


def test_a_file_that_is_not_a_database_is_refused(exported, tmp_path):
    (tmp_path / "db.json").write_text("{}")
    done = traction("identify", exported[1], "--terrain-db", tmp_path / "db.json")
    assert done.code == 2
    assert "not a terrain database" in done.err
