import pytest

from experiments.export.table_columns import plain_cell


@pytest.mark.parametrize("cell", ["=1+1", "+cmd", "-x", "@sum", "\t=1"])
def test_a_text_that_begins_like_a_formula_is_escaped(cell):
    assert plain_cell(cell) == "'" + cell


@pytest.mark.parametrize("cell", ["-1.5", "+2", "mk", "", "nan"])
def test_numbers_and_plain_texts_are_unchanged(cell):
    assert plain_cell(cell) == cell
