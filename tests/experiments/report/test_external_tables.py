"""Trials from tables are refused before any fit if a column has the wrong sign."""

import pytest

from acquisition.errors import SettingsError
from analysis.logs.record import RECORD, ImportRecord
from analysis.tables.loading import load_tables
from experiments.operator.console import Console
from experiments.report import external_tables
from experiments.report.choices import ReportRequest
from tests.experiments.program import traction


def table(path, normal_force):
    rows = [f"{k * 0.002:.3f},0.05,{normal_force},1.0" for k in range(600)]
    path.write_text("\n".join(["t [s],v_t [m/s],F_n [N],F_t [N]", *rows]) + "\n")
    return path


def test_a_negative_normal_force_is_refused_with_the_option(tmp_path):
    done = traction("fit", table(tmp_path / "a.csv", -5.0), "--to", tmp_path / "report")
    assert done.code == 2
    assert "F_n is negative in 100% of the rows" in done.err
    assert "--negate F_n" in done.err
    assert not (tmp_path / "report").exists()


@pytest.mark.slow
def test_the_option_turns_the_sign(tmp_path):
    path, to = table(tmp_path / "a.csv", -5.0), tmp_path / "report"
    done = traction("fit", path, "--to", to, "--negate", "F_n", "--models", "tustin")
    assert done.code == 0, done.err


def record_of(*warnings):
    """An import record with these warnings."""
    return ImportRecord(
        log_format="MCAP",
        robot="gantry",
        joints=("slide_x",),
        is_estimated=False,
        files=(),
        topics=(),
        arguments={},
        checks=(),
        trials={"T01": (3.0, 11.0)},
        warnings=warnings,
        losses=(),
        versions={},
    )


@pytest.mark.parametrize(
    ("warnings", "words"),
    [
        (("the moments are mirrored", "a lag"), "its import: 2, see Imported in the"),
        ((), ""),
    ],
)
def test_warnings_of_an_import_are_repeated_before_the_fit(
    tmp_path, monkeypatch, capsys, warnings, words
):
    path = table(tmp_path / "a.csv", 5.0)
    (tmp_path / RECORD).write_text(record_of(*warnings).text())
    monkeypatch.setattr(external_tables, "run_study", stopped)
    with pytest.raises(SettingsError, match="stopped before the fit"):
        external_tables.report_tables_of_trials(
            [path],
            tmp_path / "report",
            load_tables([path]),
            {},
            ReportRequest(1),
            Console(color=False),
        )
    out = capsys.readouterr().out
    assert words in out
    assert ("warnings of its import" in out) is bool(warnings)
    assert all(first in out for first in warnings[:1])


def stopped(*_, **__):
    raise SettingsError("stopped before the fit")


def test_a_fit_never_writes_into_a_folder_that_holds_something(tmp_path):
    path, to = table(tmp_path / "a.csv", 5.0), tmp_path / "out"
    to.mkdir()
    (to / "fits.json").write_text("of another fit")
    done = traction("fit", path, "--to", to, "--models", "tustin")
    assert done.code == 2
    assert "is not empty" in done.err
    assert "fitting" not in done.out
    assert (to / "fits.json").read_text() == "of another fit"


def test_a_trial_that_is_given_twice_is_refused(tmp_path):
    paths = [table(tmp_path / name, 5.0) for name in ("a.csv", "b.csv")]
    done = traction("fit", *paths, "--to", tmp_path / "out", "--models", "tustin")
    assert done.code == 2
    assert "holds the same trial as" in done.err
    assert not (tmp_path / "out").exists()
