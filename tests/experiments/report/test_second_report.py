"""A report that is made a second time computes nothing anew."""

import json
import shutil
from functools import wraps

import pytest

import analysis.report.drawing
import analysis.study.study
import analysis.study.tasks
from tests.experiments.program import only_session, traction

COMPUTED = (  # two trials have no components, and nothing is nothing to keep
    (analysis.study.study, "run_fold"),
    (analysis.study.study, "fit_terrain"),
    (analysis.study.study, "fit_planned"),
    (analysis.report.drawing, "report_figures"),
)


@pytest.fixture(scope="module")
def reported(recorded, tmp_path_factory):
    """Return data with a report, and what its fits.json holds."""
    data = tmp_path_factory.mktemp("second") / "data"
    shutil.copytree(recorded.data, data)
    done = traction("report", "S001", "--data", data)
    assert done.code == 0, done.err
    return data, numbers(data)


def numbers(data):
    return json.loads((only_session(data) / "fits.json").read_text())


@pytest.fixture
def computed(monkeypatch):
    """Return the names of what is computed while a test lasts."""
    names = []
    for module, name in COMPUTED:
        function = getattr(module, name)

        @wraps(function)  # results are kept by the function's own module and name
        def seen(*arguments, name=name, function=function, **named):
            names.append(name)
            return function(*arguments, **named)

        monkeypatch.setattr(module, name, seen)
    # in workers nobody would see it
    monkeypatch.setattr(analysis.study.tasks, "available_cores", lambda: 1)
    return names


@pytest.mark.slow
def test_a_second_report_computes_nothing_and_says_the_same(reported, computed):
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
def test_another_choice_of_samples_computes_what_it_touches(reported, computed):
    data, _ = reported
    done = traction("report", "S001", "--smooth", "15", "--data", data)
    assert done.code == 0, done.err
    assert "fit_planned" in computed
