"""A repeated report computes nothing again."""

import json
import os
import shutil
from functools import wraps

import pytest

import analysis.report.drawing
import analysis.study.study
import analysis.study.tasks
from tests.experiments.program import only_session, traction

COMPUTED = (  # two trials have no components, so none are kept
    (analysis.study.study, "run_fold"),
    (analysis.study.study, "fit_terrain"),
    (analysis.study.study, "fit_planned"),
    (analysis.report.drawing, "report_figures"),
)


@pytest.fixture(scope="module")
def reported(recorded, tmp_path_factory):
    """Data with a report, and the content of its fits.json."""
    data = tmp_path_factory.mktemp("second") / "data"
    shutil.copytree(recorded.data, data)
    done = traction("report", "S001", "--data", data)
    assert done.code == 0, done.err
    reading, fitting, *_ = lines = done.out.splitlines()
    assert reading == "Reading the trials ..."
    assert fitting.endswith(": fitting ...")
    drawing = lines.index("Drawing the paper's figures ...")
    assert drawing > 2
    opened, others = lines[drawing + 1 : drawing + 3]
    assert opened.startswith("Summary and the paper's figures, to open now: ")
    assert opened.endswith("index.html")
    assert others == "Drawing the other figures ..."
    return data, numbers(data)


def numbers(data):
    return json.loads((only_session(data) / "fits.json").read_text())


@pytest.fixture
def computed(monkeypatch):
    """Names of the functions that compute results during a test."""
    names = []
    for module, name in COMPUTED:
        function = getattr(module, name)

        @wraps(function)  # results are kept by the function's own module and name
        def seen(*arguments, name=name, function=function, **named):
            names.append(name)
            return function(*arguments, **named)

        monkeypatch.setattr(module, name, seen)
    # calls in workers would not be recorded
    monkeypatch.setattr(analysis.study.tasks, "available_cores", lambda: 1)
    return names


@pytest.mark.slow
def test_a_second_report_computes_nothing_and_has_the_same_numbers(reported, computed):
    data, first = reported
    assert traction("report", "S001", "--data", data).code == 0
    assert computed == []
    assert numbers(data) == first


@pytest.mark.slow
def test_damaged_results_are_computed_anew(reported, computed, tmp_path):
    data, first = reported
    shutil.copytree(data, tmp_path / "data")
    for path in (tmp_path / "data" / ".folds").glob("*.json"):
        path.write_bytes(path.read_bytes()[:-9])
    assert traction("report", "S001", "--data", tmp_path / "data").code == 0
    assert "fit_planned" in computed
    assert numbers(tmp_path / "data") == first


@pytest.mark.slow
def test_another_choice_of_samples_computes_the_fits_anew(reported, computed):
    data, _ = reported
    done = traction("report", "S001", "--smooth", "15", "--data", data)
    assert done.code == 0, done.err
    assert "fit_planned" in computed


@pytest.fixture
def copied(reported, tmp_path):
    """A copy of reported data whose report is up to date."""
    shutil.copytree(reported[0], tmp_path / "data")
    done = traction("report", "S001", "--data", tmp_path / "data")
    assert done.code == 0, done.err
    return tmp_path / "data"


def is_up_to_date(data, *options):
    done = traction("report", "S001", "--data", data, *options)
    assert done.code == 0, done.err
    return "up to date" in done.out


@pytest.mark.slow
def test_a_report_of_unchanged_data_is_up_to_date_and_reads_no_trial(
    copied, monkeypatch
):
    monkeypatch.setattr("experiments.report.sessions.load_trial", None)
    assert is_up_to_date(copied)


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", ["sidecar", "option", "page", "figure", "program", "trial"]
)
def test_a_report_is_made_again_if_anything_has_changed(copied, change, monkeypatch):
    options = ()
    session = only_session(copied)
    if change == "sidecar":
        traction("note", "S001", "T01", "wet", "--data", copied)
    elif change == "option":
        options = ("--smooth", "15")
    elif change == "page":
        (session / "report" / "index.html").unlink()
    elif change == "program":
        monkeypatch.setattr("experiments.report.up_to_date._program", lambda: "other")
    elif change == "figure":
        next((session / "figures").glob("*.png")).unlink()
    else:
        path = session / "trials" / "T02.mcap"
        os.utime(path, ns=(0, 0))
    assert not is_up_to_date(copied, *options)
    assert is_up_to_date(copied, *options)


@pytest.mark.slow
def test_an_incomplete_report_is_never_up_to_date(copied):
    session = only_session(copied)
    (session / "trials" / "T02.mcap").rename(session / "trials" / "T09.mcap")
    for _ in range(2):
        assert not is_up_to_date(copied, "--allow-missing")
    assert traction("report", "S001", "--data", copied).code == 6


@pytest.mark.slow
def test_a_record_that_cannot_be_written_does_not_fail_the_report(copied):
    records = (copied / ".folds").glob("report-*.json")
    record = max(records, key=lambda path: path.stat().st_mtime_ns)
    record.unlink()
    record.mkdir()
    assert not is_up_to_date(copied)
    assert not is_up_to_date(copied)
