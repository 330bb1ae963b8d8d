"""Data packages and Parquet tables that are damaged, foreign or hostile."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import SettingsError
from acquisition.formats import FORMAT
from analysis.tables.data_package import (
    DESCRIPTOR,
    DataPackage,
    PackageFile,
    TableOrigin,
    TableSchema,
)
from analysis.tables.loading import load_tables
from analysis.tables.parquet import MOST_ROWS, to_parquet

ROWS = "t [s],v_t [mm/s],F_n [N],F_t [N]\n" + "".join(
    f"{0.002 * k:.3f},{10 + k},4.0,{2 + 0.1 * k:.1f}\n" for k in range(6)
)


def write_package(folder: Path, path="S1/T01.csv", text=ROWS, **changes) -> Path:
    """Write a package of one table, with changes to its entry of the file."""
    file = folder / "S1" / "T01.csv"
    file.parent.mkdir(exist_ok=True)
    file.write_text(text)
    entry = {
        "name": "t01",
        "path": path,
        "format": "csv",
        "mediatype": "text/csv",
        "bytes": len(text),
        "hash": f"sha256:{hashlib.sha256(text.encode()).hexdigest()}",
        "schema": TableSchema(fields=()),
        "traction": TableOrigin(
            table="trial", session="S7", trial="T01", terrain="gravel", stones="small"
        ),
    } | changes
    resources = (PackageFile.model_validate(entry),)
    package = DataPackage(name="p", version=FORMAT, resources=resources)
    (folder / DESCRIPTOR).write_text(package.text())
    return file


def test_a_table_has_the_terrain_and_stones_of_its_package(tmp_path):
    write_package(tmp_path)
    ((terrain, (trial,)),) = load_tables([tmp_path]).items()
    assert (terrain, trial.name, trial.stones) == ("gravel", "S7/T01", "small")
    assert trial.v_t[:2] == pytest.approx([0.010, 0.011])  # in m/s


def test_the_descriptor_itself_names_the_package(tmp_path):
    write_package(tmp_path)
    assert list(load_tables([tmp_path / DESCRIPTOR])) == ["gravel"]


def test_one_changed_digit_is_reported(tmp_path):
    file = write_package(tmp_path)
    file.write_text(ROWS.replace("10,4.0", "10,5.0"))
    for path in (tmp_path, file):
        with pytest.raises(SettingsError, match=r"T01\.csv: is changed: SHA-256"):
            load_tables([path])


def test_a_truncated_file_is_reported_with_both_sizes(tmp_path):
    file = write_package(tmp_path)
    file.write_text(ROWS[:-5])
    with pytest.raises(SettingsError, match=f"{len(ROWS) - 5} bytes.*{len(ROWS)}"):
        load_tables([tmp_path])


def test_a_missing_file_is_reported(tmp_path):
    write_package(tmp_path).unlink()
    with pytest.raises(SettingsError, match=r"T01\.csv"):
        load_tables([tmp_path])


@pytest.mark.parametrize("path", ["../T01.csv", "/etc/passwd", "S1/../../x", "S1\\T01"])
def test_a_path_that_leads_out_of_the_package_is_refused(tmp_path, path):
    write_package(tmp_path, path=path)
    with pytest.raises(SettingsError, match="points outside"):
        load_tables([tmp_path])


def test_a_link_instead_of_a_table_is_not_followed(tmp_path):
    file = write_package(tmp_path)
    file.rename(tmp_path / "elsewhere.csv")
    file.symlink_to(tmp_path / "elsewhere.csv")
    with pytest.raises(SettingsError, match=r"T01\.csv"):
        load_tables([tmp_path])


def test_a_package_folder_may_not_be_a_link(tmp_path):
    write_package(tmp_path)
    (tmp_path / "S1").rename(tmp_path / "S2")
    (tmp_path / "S1").symlink_to(tmp_path / "S2")
    with pytest.raises(SettingsError, match="symbolic link"):
        load_tables([tmp_path])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        "[" * 5000,
        '{"name": "p"}',
        '{"name": "p", "resources": [{"name": "a"}]}',
        '{"name": "p", "resources": [{"bytes": -1}]}',
    ],
)
def test_an_invalid_package_is_refused_by_name(tmp_path, text):
    (tmp_path / DESCRIPTOR).write_text(text)
    with pytest.raises(SettingsError, match=DESCRIPTOR):
        load_tables([tmp_path])


def test_a_package_without_a_trial_is_refused(tmp_path):
    write_package(tmp_path, traction=TableOrigin(table="index"))
    with pytest.raises(SettingsError, match="no trials"):
        load_tables([tmp_path])


def test_a_folder_without_a_package_is_refused(tmp_path):
    with pytest.raises(SettingsError, match=DESCRIPTOR):
        load_tables([tmp_path])


def test_a_terrain_given_for_csv_files_does_not_rename_a_package(tmp_path):
    write_package(tmp_path)
    assert list(load_tables([tmp_path], terrain="mine")) == ["gravel"]


def columns(count=6, **more):
    steps = np.arange(count, dtype=float)
    forces = {"F_n": 4.0 + 0 * steps, "F_t": 2.0 + 0.1 * steps}
    return {"t": 0.002 * steps, "v_t": 10.0 + steps, **forces, **more}


def parquet(path: Path, content=None, units=None) -> Path:
    path.write_bytes(to_parquet(content or columns(), units or {}))
    return path


def test_units_of_a_parquet_column_are_converted(tmp_path):
    path = parquet(tmp_path / "a.parquet", units={"v_t": "mm/s"})
    ((_, (trial,)),) = load_tables([path]).items()
    assert trial.v_t[:2] == pytest.approx([0.010, 0.011])


def test_parquet_columns_can_be_named(tmp_path):
    named = {
        "F_t" if k == "F_n" else "F_n" if k == "F_t" else k: v
        for k, v in columns().items()
    }
    path = parquet(tmp_path / "a.parquet", named)
    ((_, (trial,)),) = load_tables([path], {"F_n": "F_t", "F_t": "F_n"}).items()
    assert trial.F_n.max() == 4.0


def test_a_parquet_table_of_other_columns_is_reported_with_its_columns(tmp_path):
    path = parquet(tmp_path / "a.parquet", {"x": np.arange(5.0)})
    with pytest.raises(SettingsError, match=r"no column t, v_t, F_n, F_t; it has x"):
        load_tables([path])


def test_words_instead_of_numbers_are_refused(tmp_path):
    content = columns() | {"F_t": np.array(list("abcdef"))}
    with pytest.raises(SettingsError, match="column F_t holds string"):
        load_tables([parquet(tmp_path / "a.parquet", content)])


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_truncated_parquet_file_is_refused(tmp_path, share):
    path = parquet(tmp_path / "a.parquet")
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(SettingsError, match="not a readable Parquet"):
        load_tables([path])


def test_a_small_file_with_too_many_rows_is_not_unpacked(tmp_path):
    zeros = np.zeros(MOST_ROWS + 1)
    path = parquet(tmp_path / "a.parquet", dict.fromkeys(columns(), zeros))
    assert path.stat().st_size < 1_000_000
    with pytest.raises(SettingsError, match="rows"):
        load_tables([path])


def test_a_table_with_a_time_column_takes_no_rate(tmp_path):
    path = parquet(tmp_path / "a.parquet")
    with pytest.raises(SettingsError, match="time of its own"):
        load_tables([path], rate=500.0)


def test_an_invalid_origin_is_omitted(tmp_path):
    import pyarrow
    import pyarrow.parquet

    path = parquet(tmp_path / "a.parquet")
    table = pyarrow.parquet.read_table(path).replace_schema_metadata(
        {"traction": json.dumps({"table": "nonsense"})}
    )
    pyarrow.parquet.write_table(table, path)
    assert list(load_tables([path])) == ["table"]
