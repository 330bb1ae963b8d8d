import io
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition.errors import SettingsError
from analysis.data.terrain_kinds import parse_stones
from analysis.tables import loading as tables
from analysis.tables.columns import (
    parse_columns,
    parse_inputs,
    parse_lines,
    parse_units,
)
from analysis.tables.loading import load_tables

GOOD = "t,v_t,F_n,F_t\n0,0.1,2,1\n0.1,0.1,2,1\n0.2,0.1,2,1\n"


def write(folder, text, name="trial.csv"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def rows(n=5):
    return np.column_stack([np.arange(n), np.ones(n), np.ones(n), np.ones(n)])


def test_npz_gives_its_terrains_in_the_order_of_the_file(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, **{"TF/00": rows(), "B0/00": rows(), "TF/01": rows(7)})
    trials = load_tables([path])
    assert list(trials) == ["TF", "B0"]
    assert [series.t.size for series in trials["TF"]] == [5, 7]


def test_csv_is_read_with_renamed_columns_in_any_order(tmp_path):
    path = write(tmp_path, "Ft,x,vt,Fn,time\n9,0,0.1,3,0\n9,0,0.1,3,.1\n9,0,0.1,3,.2\n")
    columns = parse_columns("t=time, v_t=vt,F_n=Fn,F_t=Ft")
    (series,) = load_tables([path], columns, "gravel")["gravel"]
    assert series.F_t[0] == 9.0
    assert series.F_n[0] == 3.0
    assert series.t[2] == 0.2


def test_a_csv_without_a_terrain_is_named_table(tmp_path):
    assert list(load_tables([write(tmp_path, GOOD)])) == ["table"]


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_stated_separator_and_decimal_comma_are_read(tmp_path, separator):
    text = GOOD.replace(",", separator).replace(".", ",")
    path = write(tmp_path, text)
    (series,) = load_tables([path], separator=separator, decimal=",")["table"]
    assert series.v_t[0] == 0.1
    assert series.t[-1] == 0.2


@pytest.mark.parametrize("header", ["v_t [mm/s]", "v_t (mm/s)", "v_t[mm/s]"])
def test_a_unit_in_the_header_is_converted(tmp_path, header):
    text = GOOD.replace("v_t", header).replace("0.1,2", "100,2")
    assert load_tables([write(tmp_path, text)])["table"][0].v_t[0] == 0.1


def test_headers_with_units_are_read(tmp_path):
    text = GOOD.replace("t,v_t,F_n,F_t", "t [s],v_t [m/s],F_n [N],F_t [N]")
    assert load_tables([write(tmp_path, text)])["table"][0].F_n[0] == 2.0


def test_a_unit_can_be_given_for_a_csv_and_an_npz(tmp_path):
    np.savez(tmp_path / "a.npz", **{"TF/00": rows()})
    paths = [write(tmp_path, GOOD), tmp_path / "a.npz"]
    units = parse_units("F_t=mN,t=ms")
    trials = load_tables(paths, units=units)
    assert trials["table"][0].F_t[0] == trials["TF"][0].F_t[0] == 1e-3
    assert trials["TF"][0].t[1] == 1e-3


@pytest.mark.parametrize(
    ("header", "units", "reason"),
    [
        ("v_t [km/h]", {}, "km/h"),
        ("v_t [mm/s]", {"v_t": "m/s"}, "mm/s.*m/s"),
    ],
)
def test_units_unknown_or_contradicted_are_refused(tmp_path, header, units, reason):
    path = write(tmp_path, GOOD.replace("v_t", header))
    with pytest.raises(SettingsError, match=reason):
        load_tables([path], units=units)


@pytest.mark.parametrize(
    "header", ["t,v_t [m/s],v_t [mm/s],F_n,F_t", "t,v_t,v_t,F_n,F_t"]
)
def test_a_duplicated_column_is_refused(tmp_path, header):
    path = write(tmp_path, header + "\n0,0.1,100,2,1\n1,0.1,100,2,1\n2,0.1,100,2,1\n")
    with pytest.raises(SettingsError, match="v_t occurs twice"):
        load_tables([path])


def test_a_number_with_comma_and_point_is_refused(tmp_path):
    path = write(tmp_path, "t;v_t;F_n;F_t\n0;0.1;1,234.5;1\n1;0.1;2;1\n2;0.1;2;1\n")
    with pytest.raises(SettingsError, match=r"line 2, column F_n: '1,234\.5'"):
        load_tables([path], separator=";")


@pytest.mark.parametrize(
    ("text", "lines"), [("1", {1}), ("1-3,5", {1, 2, 3, 5}), (" 2 , 4", {2, 4})]
)
def test_line_lists_contain_numbers_and_ranges(text, lines):
    assert parse_lines(text) == lines


@pytest.mark.parametrize("text", ["0", "3-1", "x", "1-", "1-99999999", "-2"])
def test_an_invalid_line_list_is_refused(text):
    with pytest.raises(SettingsError, match=r"--skip .* is no line"):
        parse_lines(text)


@pytest.mark.parametrize("text", ['"v_t=a', 't=t_s,"v_t="a"'])
def test_unclosed_quotes_in_an_option_are_refused(text):
    with pytest.raises(SettingsError, match="quotes do not fit"):
        parse_columns(text)


def test_an_item_with_a_comma_may_be_quoted():
    assert parse_columns('t=t_s,"v_t=Speed, foot"')["v_t"] == "Speed, foot"
    assert parse_inputs('v_t,F_n,"Skid, deg"') == ("Skid, deg",)


@pytest.mark.parametrize("text", ["v_t", "v_t=km/h", "x=m", "v_t=N"])
def test_a_unit_that_a_column_cannot_have_is_refused(text):
    with pytest.raises(SettingsError, match=text):
        parse_units(text)


def test_byte_order_mark_and_quotes_are_accepted(tmp_path):
    text = "\ufeff" + GOOD.replace("t,v_t", '"t","v_t"')
    assert load_tables([write(tmp_path, text)])["table"][0].t.size == 3


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "empty"),
        ("t,v_t,F_n,F_t\n", "no rows"),
        ("time,v\n0,1\n", r"no column t, v_t, F_n, F_t; it has time, v"),
        (GOOD + "0.3,fast,2,1\n", "line 5, column v_t: 'fast'"),
        (GOOD + "0.3,1\n", "line 5: 2 cells below 4 names"),
        (b"\x93NUMPY\xff\xfe", "a NumPy array"),
        (b"PK\x03\x04 and then nothing of the sort", "not a readable npz"),
    ],
)
def test_a_file_that_is_not_a_table_is_refused_by_name(tmp_path, content, reason):
    with pytest.raises(SettingsError, match=r"trial\.csv.*" + reason):
        load_tables([write(tmp_path, content)])


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(SettingsError, match=r"gone\.csv: cannot be read"):
        load_tables([tmp_path / "gone.csv"])


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="cannot be read"):
        load_tables([tmp_path])


def test_an_empty_list_of_files_is_refused():
    with pytest.raises(SettingsError, match="No table"):
        load_tables([])


def test_a_zip_that_is_not_an_npz_is_refused_with_its_contents(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(SettingsError, match=r"holds readme\.txt"):
        load_tables([path])


def test_an_array_of_objects_is_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, **{"S0/00": np.array([[object()] * 4], dtype=object)})
    with pytest.raises(SettingsError, match="not a readable npz"):
        load_tables([path])


@pytest.mark.parametrize("array", [rows()[:, :3], rows()[0], rows().astype("U8")])
def test_array_of_another_form_is_refused(tmp_path, array):
    path = tmp_path / "a.npz"
    np.savez(path, **{"S0/00": array})
    with pytest.raises(SettingsError, match="array S0/00 has shape"):
        load_tables([path])


def test_truncated_npz_is_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, **{"S0/00": rows()})
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(SettingsError, match="not a readable npz"):
        load_tables([path])


def test_header_that_claims_a_gigantic_array_is_refused(tmp_path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (10**15, 4), }"
    header = header.replace(b"10**15", b"1000000000000000")
    header += b" " * (118 - 1 - len(header)) + b"\n"
    array = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("S0/00.npy", array)
    with pytest.raises(SettingsError, match="not a readable npz"):
        load_tables([path])


def test_npz_that_unpacks_beyond_the_limit_is_refused_unopened(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, **{"S0/00": np.zeros((5000, 4))})
    monkeypatch.setattr(tables, "LARGEST_FILE", 100_000)
    assert path.stat().st_size < 100_000
    with pytest.raises(SettingsError, match="the limit is"):
        load_tables([path])


def test_many_trials_in_an_npz_are_limited_only_by_memory(tmp_path, monkeypatch):
    path, rng = tmp_path / "a.npz", np.random.default_rng(0)
    t = 0.002 * np.arange(300_000.0)
    made = {f"S0/{k}": np.column_stack([t, rng.random((t.size, 3))]) for k in range(3)}
    np.savez(path, **made)
    assert path.stat().st_size > 28_000_000
    assert len(load_tables([path])["S0"]) == 3
    monkeypatch.setattr(tables, "share_of_memory", lambda _, least: least)
    with pytest.raises(SettingsError, match="29 MB, the limit is 24 MB"):
        load_tables([path])


@pytest.mark.parametrize("text", ["t", "speed=v", "t=", "=x"])
def test_unmatched_column_names_are_refused(text):
    with pytest.raises(SettingsError, match="does not name a column"):
        parse_columns(text)


def test_stones_are_stated_by_terrain_and_otherwise_unknown(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, **{"Sand/00": rows(), "Beach/00": rows(), "moon/00": rows()})
    trials = load_tables([path], stones=parse_stones("Sand=none, Beach=small"))
    stones = {name: series.stones for name, (series,) in trials.items()}
    assert stones == {"Sand": "none", "Beach": "small", "moon": ""}


@pytest.mark.parametrize("text", ["Sand", "Sand=", "=none", "Sand=gravel"])
def test_stones_without_a_size_are_refused(text):
    with pytest.raises(SettingsError, match="does not give the stones"):
        parse_stones(text)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(
    noise=st.binary(max_size=300), start=st.sampled_from([b"", b"PK\x03\x04", b"t,"])
)
def test_random_bytes_are_refused(tmp_path, noise, start):
    path = write(tmp_path, start + noise, "noise")
    with pytest.raises(SettingsError):
        load_tables([path])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(index=st.integers(0, 600), value=st.integers(0, 255))
def test_an_npz_with_a_wrong_byte_is_read_or_refused(tmp_path, index, value):
    stream = io.BytesIO()
    np.savez(stream, **{"S0/00": rows()})
    content = bytearray(stream.getvalue())
    content[index % len(content)] = value
    path = write(tmp_path, bytes(content), "flipped.npz")
    try:
        trials = load_tables([path])
    except SettingsError:
        return
    assert all(series.t.size for found in trials.values() for series in found)


def test_rows_without_a_time_are_spread_by_the_rate(tmp_path):
    path = write(tmp_path, "v_t,F_n,F_t\n0.1,2,1\n0.2,2,1\n0.3,2,1\n")
    series = load_tables([path], rate=200.0)["table"][0]
    np.testing.assert_allclose(series.t, [0.0, 0.005, 0.010])
    np.testing.assert_allclose(series.v_t, [0.1, 0.2, 0.3])


def test_rows_without_a_time_are_refused_with_the_option_rate(tmp_path):
    path = write(tmp_path, "v_t,F_n,F_t\n0.1,2,1\n0.2,2,1\n0.3,2,1\n")
    with pytest.raises(SettingsError) as refused:
        load_tables([path])
    assert "--rate" in refused.value.hint


def test_a_rate_together_with_a_time_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="a time column"):
        load_tables([write(tmp_path, GOOD)], rate=200.0)


def test_a_rate_together_with_an_npz_is_refused(slice_path):
    with pytest.raises(SettingsError, match="a time of its own"):
        load_tables([slice_path], rate=200.0)


def test_a_table_of_kept_samples_is_recognised_by_its_column(tmp_path):
    header, rest = GOOD.split("\n", 1)
    rows = [f"{row},{k}" for k, row in enumerate(rest.strip().split("\n"))]
    path = write(tmp_path, "\n".join([f"{header},kept_row [1]", *rows, ""]))
    assert load_tables([path])["table"][0].is_prepared
    assert not load_tables([write(tmp_path, GOOD)])["table"][0].is_prepared


@pytest.mark.parametrize("rate", [0, -200.0, np.nan, np.inf, True, "200"])
def test_an_invalid_rate_is_refused(tmp_path, rate):
    path = write(tmp_path, "v_t,F_n,F_t\n" + "0.1,2,1\n" * 5)
    with pytest.raises(SettingsError, match="is not a rate"):
        load_tables([path], rate=rate)


@pytest.mark.parametrize("rate", [200, np.float64(200.0), np.int64(200)])
def test_any_positive_rate_is_accepted(tmp_path, rate):
    path = write(tmp_path, "v_t,F_n,F_t\n" + "0.1,2,1\n" * 5)
    assert load_tables([path], rate=rate)["table"][0].t[1] == 0.005


@pytest.mark.parametrize("column", ["v_t", "F_n", "F_t"])
@pytest.mark.parametrize("value", ["1e300", "-3.4e38", "2e9"])
def test_a_value_that_no_foot_has_is_refused_with_its_line(tmp_path, column, value):
    lines = [GOOD.splitlines()[0]]
    lines += [f"{0.1 * k:.1f},0.1,2,1" for k in range(30)]
    cells = lines[20].split(",")
    cells[["t", "v_t", "F_n", "F_t"].index(column)] = value
    lines[20] = ",".join(cells)
    path = write(tmp_path, "\n".join(lines) + "\n")
    with pytest.raises(SettingsError, match=f"line 21, column {column}: .* no measur"):
        load_tables([path])
