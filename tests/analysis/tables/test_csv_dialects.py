"""Files of sixteen dialects are read according to their stated description."""

import json

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.tables.loading import load_tables
from tests.analysis.tables.stated_dialects import STATED

pytestmark = pytest.mark.shared_data
DIALECTS = (
    "comma_point",
    "semicolon_comma",
    "bom_crlf",
    "utf16_tab",
    "sep_line",
    "units_row",
    "preamble_hash",
    "empty_cells",
    "word_in_column",
    "space_columns",
    "no_header",
    "german_thousands",
    "comma_comma",
    "mu_sign",
    "grams_force",
    "negative_load",
)


@pytest.fixture(scope="module")
def folder(shared_data):
    return shared_data / "real" / "csv_dialects"


@pytest.fixture(scope="module")
def expected(folder):
    return json.loads((folder / "expected.json").read_text())


def test_every_dialect_is_tested(expected):
    assert set(expected) == set(DIALECTS)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_is_read_or_refused_as_described(folder, expected, dialect):
    path, wanted = folder / f"{dialect}.csv", expected[dialect]
    stated = STATED.get(dialect, {})
    if wanted["want"] == "refused":
        with pytest.raises(SettingsError, match=rf"{dialect}\.csv, line \d+"):
            load_tables([path], **stated)
        return
    ((series,),) = load_tables([path], **stated).values()
    sums = [column.sum() for column in (series.t, series.v_t, series.F_n, series.F_t)]
    assert len(series.t) == wanted["rows"]
    assert series.dropped_rows == wanted.get("dropped", 0)
    np.testing.assert_allclose(sums, wanted["sums"], atol=5e-5)


@pytest.mark.parametrize("dialect", [n for n in STATED if n != "negative_load"])
def test_an_ambiguous_dialect_is_refused_with_one_line(folder, dialect):
    with pytest.raises(SettingsError, match=rf"{dialect}\.csv, line \d+"):
        load_tables([folder / f"{dialect}.csv"])
