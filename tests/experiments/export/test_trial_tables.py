"""Tables that `traction export` writes: their content, and reading them again."""

import csv
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from frictionless import Package, system

from acquisition.trial_file.reader import TrialReader
from analysis.data.load import load_trial
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.tables.loading import load_tables
from experiments.export.quantities import KEPT, QUANTITIES, kept_rule
from experiments.export.table_columns import columns_of, decimals_of
from tests.experiments.program import digest, traction

COLUMNS = ("t", "v_t", "F_n", "F_t")


def export(recorded, to, form):
    options = ("--to", to, "--format", form, "--data", recorded.data)
    done = traction("export", "S001", *options)
    assert (done.code, done.err) == (0, "")
    return to


@pytest.fixture(scope="module")
def exported(recorded, tmp_path_factory):
    return export(recorded, tmp_path_factory.mktemp("tables") / "new", "csv")


@pytest.fixture(scope="module")
def in_parquet(recorded, tmp_path_factory):
    return export(recorded, tmp_path_factory.mktemp("parquet") / "new", "parquet")


def table(path):
    with path.open() as file:
        header, *rows = csv.reader(file)
    return header, {name: [row[i] for row in rows] for i, name in enumerate(header)}


def numbers(path, name):
    return np.array(table(path)[1][name], dtype=float)


def half_steps():
    """Largest rounding error of every numeric column, by the name with its unit."""
    return {
        f"{name} [{q.unit}]": 0.5 * 10.0**-q.decimals
        for q in QUANTITIES
        if q.kind == "number"
        for name in q.names
    }


def test_a_table_holds_every_cycle_with_units(exported, recorded, first_trial):
    header, columns = table(exported / recorded.folder.name / "T01.csv")
    trial = load_trial(first_trial)
    assert len(columns["t [s]"]) == len(trial.t)
    assert {"t [s]", "q1 [rad]", "v_t [m/s]", "F_n [N]"} <= set(header)


@pytest.mark.parametrize("name", ["F_n [N]", "F_t [N]", "v_t [m/s]", "q7 [rad]"])
def test_a_number_differs_from_the_recording_by_half_a_step_at_most(
    exported, recorded, first_trial, name
):
    trial = load_trial(first_trial)
    recordings = {
        "F_n [N]": trial.traction[:, 2],
        "F_t [N]": trial.traction[:, 1],
        "v_t [m/s]": trial.traction[:, 0],
        "q7 [rad]": TrialReader(first_trial).cycles().data["position"][:, 6],
    }
    written = numbers(exported / recorded.folder.name / "T01.csv", name)
    # with a tolerance for the binary form of decimal numbers
    assert np.abs(written - recordings[name]).max() <= half_steps()[name] * (1 + 1e-9)


@pytest.mark.parametrize(
    ("resolution", "decimals"), [(4e-3, 4), (1e-3, 4), (1.6e-4, 5), (3.6e-5, 6), (0, 0)]
)
def test_digits_end_at_a_tenth_of_the_resolution(resolution, decimals):
    assert decimals_of(resolution) == decimals


def test_a_force_has_no_digit_below_a_tenth_of_a_count(exported, recorded):
    _, columns = table(exported / recorded.folder.name / "T01.csv")
    digits = {len(cell.partition(".")[2]) for cell in columns["F_n [N]"]}
    assert max(digits) == 4  # a count is 1/256 N


def test_a_velocity_has_more_digits_than_its_resolution(exported, recorded):
    _, columns = table(exported / recorded.folder.name / "T01.csv")
    digits = {
        len(cell.partition(".")[2]) for cell in columns["v_t [m/s]"] if "e" not in cell
    }
    assert max(digits) == decimals_of(1.6e-4) + 2


def test_flags_are_columns_and_the_safety_mode_is_a_word(
    exported, recorded, first_trial
):
    _, columns = table(exported / recorded.folder.name / "T01.csv")
    flags = load_trial(first_trial).cycles["flags"]
    assert set(columns["safety_mode"]) == {"active"}
    assert set(columns["simulated [1]"]) == {"1"}
    joint7 = [str(flag >> 11 & 1) for flag in flags.tolist()]
    assert columns["joint7_locked [1]"] == joint7
    third_motor = [str(flag >> 16 & 1) for flag in flags.tolist()]
    assert columns["motor_fresh3 [1]"] == third_motor
    assert "flags [bits]" not in columns


def test_the_kept_samples_are_those_inside_the_window(exported, recorded):
    path = exported / recorded.folder.name / "T01.kept.csv"
    names = ["t [s]", "v_t [m/s]", "F_n [N]", "F_t [N]", "kept_row [1]"]
    assert table(path)[0] == [*names, "simulated [1]"]
    v_t = numbers(path, "v_t [m/s]")
    assert 0.005 <= v_t.min() <= v_t.max() <= 0.2
    rows = numbers(path, "kept_row [1]").astype(int)
    whole = numbers(path.with_name("T01.csv"), "t [s]")
    assert numbers(path, "t [s]") == pytest.approx(whole[rows], abs=0)


def test_every_column_is_in_the_dictionary(exported, recorded):
    with (exported / "data_dictionary.csv").open() as file:
        rows = list(csv.DictReader(file))
    for name in ("T01.csv", "T01.kept.csv"):
        of_table = [r for r in rows if r["table"] == name and r["type"] != "rule"]
        units = [f" [{r['unit']}]" if r["unit"] else "" for r in of_table]
        headers = [r["column"] + u for r, u in zip(of_table, units, strict=True)]
        assert headers == table(exported / recorded.folder.name / name)[0]
    of_index = [r["column"] for r in rows if r["table"] == "trials.csv"]
    assert of_index == table(exported / "trials.csv")[0]
    assert all(row["meaning"] for row in rows)


def test_the_dictionary_states_the_rule_of_the_kept_samples(exported):
    with (exported / "data_dictionary.csv").open() as file:
        (rule,) = [r for r in csv.DictReader(file) if r["type"] == "rule"]
    assert rule["meaning"] == kept_rule(PrepareOptions())
    for number in ("11 samples", "22 ms", "0.005", "0.2", "250"):
        assert number in rule["meaning"]


def test_checksums_of_all_files_are_right(exported):
    lines = (exported / "SHA256SUMS").read_text().splitlines()
    listed = dict(reversed(line.split("  ")) for line in lines)
    files = {str(p.relative_to(exported)) for p in exported.rglob("*") if p.is_file()}
    assert set(listed) == files - {"SHA256SUMS"}
    assert all(digest(exported / name) == value for name, value in listed.items())


def test_simulated_trials_are_marked_in_the_index(exported, first_trial):
    with (exported / "trials.csv").open() as file:
        first, second = csv.DictReader(file)
    assert first["simulated"] == second["simulated"] == "true"
    assert first["sha256 of the recording"] == digest(first_trial)


def test_an_export_overwrites_nothing(recorded, exported):
    done = traction("export", "S001", "--to", exported, "--data", recorded.data)
    assert done.code == 2
    assert "is not empty" in done.err


@pytest.fixture
def frictionless_report():
    """A function that validates a package with Frictionless's own program."""

    def validate(folder: Path):
        with system.use_context(trusted=True):
            return Package(str(folder / "datapackage.json")).validate()

    return validate


@pytest.mark.filterwarnings("ignore")  # of that program
def test_frictionless_finds_every_column_and_checksum_right(
    exported, frictionless_report
):
    report = frictionless_report(exported)
    assert report.flatten(["type", "message"]) == []
    assert len(report.tasks) == 6  # two trials, two tables each; index and dictionary


def test_every_column_of_the_package_has_its_unit(exported, recorded):
    package = json.loads((exported / "datapackage.json").read_text())
    tables = {resource["path"]: resource for resource in package["resources"]}
    whole = tables[f"{recorded.folder.name}/T01.csv"]
    units = {f["name"]: f["unit"] for f in whole["schema"]["fields"]}
    assert (units["v_t [m/s]"], units["tau1 [N m]"]) == ("m/s", "N m")
    assert all(f["description"] for f in whole["schema"]["fields"])
    kept = tables[f"{recorded.folder.name}/T01.kept.csv"]
    assert kept_rule(PrepareOptions()) in kept["description"]


# --- read again -----------------------------------------------------------------------


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_an_exported_folder_is_read_as_its_trials(
    exported, in_parquet, recorded, first_trial, form
):
    folder = exported if form == "csv" else in_parquet
    ((terrain, trials),) = load_tables([folder]).items()
    own = load_trial(first_trial).series()
    assert (terrain, [trial.name for trial in trials]) == (
        "TF",
        ["S001/T01", "S001/T02"],
    )
    first = trials[0]
    assert (first.stones, first.is_simulated) == (own.stones, True)
    assert first.incline_deg == pytest.approx(own.incline_deg)
    assert first.stamped_lag == pytest.approx(own.stamped_lag)
    for name in COLUMNS:
        error = np.abs(getattr(first, name) - getattr(own, name)).max()
        assert error <= 5.001e-5  # N; of t and v_t less


def test_both_formats_hold_the_same_numbers(exported, in_parquet):
    (ours,), (theirs,) = (
        load_tables([folder]).values() for folder in (exported, in_parquet)
    )
    for one, other in zip(ours, theirs, strict=True):
        for name in COLUMNS:
            assert (getattr(one, name) == getattr(other, name)).all()


def test_kept_samples_of_the_tables_are_those_of_the_recording(exported, first_trial):
    trials = load_tables([exported])["TF"]
    own = prepare_trial(load_trial(first_trial).series(), PrepareOptions())
    again = prepare_trial(trials[0], PrepareOptions())
    assert (again.indices == own.indices).all()
    assert np.abs(again.F_t - own.F_t).max() <= 5.001e-5  # N


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_a_single_table_takes_its_terrain_from_the_package(
    exported, in_parquet, recorded, form
):
    folder = exported if form == "csv" else in_parquet
    path = folder / recorded.folder.name / f"T01.{form}"
    assert list(load_tables([path])) == ["TF"]
    assert list(load_tables([path], terrain="mine")) == ["mine"]


def test_a_parquet_table_alone_states_its_terrain(in_parquet, recorded, tmp_path):
    path = tmp_path / "T01.parquet"
    path.write_bytes((in_parquet / recorded.folder.name / "T01.parquet").read_bytes())
    ((terrain, (trial,)),) = load_tables([path]).items()
    assert (terrain, trial.name, trial.stones) == ("TF", "S001/T01", "none")


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_kept_tables_are_recognised_as_prepared(exported, in_parquet, recorded, form):
    folder = exported if form == "csv" else in_parquet
    path = folder / recorded.folder.name / f"T01.kept.{form}"
    ((_, (trial,)),) = load_tables([path]).items()
    assert trial.is_prepared


@pytest.mark.slow
def test_fit_reports_an_exported_folder_as_simulated(in_parquet, tmp_path):
    done = traction("fit", in_parquet, "--to", tmp_path / "fit")
    assert done.code == 0
    fits = json.loads((tmp_path / "fit" / "fits.json").read_text())
    assert (list(fits["terrains"]), fits["simulated"]) == (["TF"], True)
    assert "SIMULATED" in (tmp_path / "fit" / "report" / "index.html").read_text()


def test_fit_refuses_to_mix_simulated_and_recorded_tables(exported, recorded, tmp_path):
    name = f"{recorded.folder.name}/T01.csv"
    real = tmp_path / "real.csv"
    with (exported / name).open() as file:
        rows = list(csv.DictReader(file))
    with real.open("w") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(row | {"simulated [1]": "0"} for row in rows)
    done = traction("fit", exported / name, real, "--to", tmp_path / "fit")
    assert done.code == 2
    assert not (tmp_path / "fit").exists()


@pytest.mark.parametrize("name", ["T01.csv", "T01.kept.csv"])
def test_a_table_copied_out_of_its_folder_stays_simulated(
    exported, recorded, tmp_path, name
):
    copy = tmp_path / name
    copy.write_bytes((exported / recorded.folder.name / name).read_bytes())
    ((series,),) = load_tables([copy]).values()
    assert series.is_simulated


def test_without_pyarrow_the_extra_is_reported_and_nothing_written(
    recorded, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    options = ("--to", tmp_path / "new", "--format", "parquet")
    done = traction("export", "S001", *options, "--data", recorded.data)
    assert done.code == 2
    assert "traction[parquet]" in done.err
    assert not (tmp_path / "new").exists()


def test_columns_are_those_of_the_quantities(first_trial):
    trial = load_trial(first_trial)
    names = [column.name for column in columns_of(QUANTITIES, trial)]
    assert names == [name for q in QUANTITIES for name in q.names]
    prepared = prepare_trial(trial.series(), PrepareOptions())
    assert {c.values.size for c in columns_of(KEPT, prepared)} == {prepared.kept}
