"""README's figures are those of a run: a drift of 5 % is noticed."""

import json

import pytest

from benchmarks import readme
from benchmarks.readme import (
    README,
    demo_rows,
    is_same,
)


def results(mae):
    terrain = {"mae": {"tustin": mae, "gp_se": 0.39}, "constant_mae": 0.66}
    table = {"name": "Measured against true", "rows": [["T01", "0.5", "0.3", "0.2"]]}
    return {"terrains": {"TF": terrain, "S0": terrain}, "tables": [table]}


@pytest.mark.parametrize(("mae", "same"), [(0.40, True), (0.41, True), (0.45, False)])
def test_a_figure_may_drift_by_a_small_share_only(mae, same):
    stated, seen = demo_rows(results(0.40))[0], demo_rows(results(mae))[0]
    assert is_same(seen, stated) is same


def test_another_sentence_is_another_row():
    first, second, _ = demo_rows(results(0.40))
    assert not is_same(first, second)


def test_readme_has_every_row():
    words = {row.split("|")[1].strip()[:30] for row in demo_rows(results(0.4))}
    assert all(word in README.read_text() for word in words)


def test_a_warning_of_the_demo_is_a_failure(tmp_path, monkeypatch, capsys):
    rows = demo_rows(results(0.4))
    page = tmp_path / "README.md"
    page.write_text("\n".join(rows))
    monkeypatch.setattr(readme, "README", page)
    (tmp_path / "study").mkdir()
    fits = tmp_path / "study" / "fits.json"
    monkeypatch.setattr("sys.argv", ["readme", "--folder", str(tmp_path)])
    fits.write_text(json.dumps({**results(0.4), "warnings": []}))
    assert readme.main() == 0
    fits.write_text(json.dumps({**results(0.4), "warnings": ["the force is late"]}))
    assert readme.main() == 1
    assert "! the force is late" in capsys.readouterr().out
