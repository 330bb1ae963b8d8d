"""A corrected formula never shows an old number: results are keyed by their code."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.report.drawing import report_figures
from analysis.study.break_away_fit import fit_planned
from analysis.study.crossval import run_fold
from analysis.study.digests import ROOT, code_digest, source_files
from analysis.study.terrain_fit import fit_terrain
from analysis.study.trial_components import fit_components
from analysis.terrains.tabulation import tabulate

FOLDS = "analysis.study.crossval"


@pytest.fixture
def copy(tmp_path):
    """The sources, copied to where they may be changed."""
    for package in ("acquisition", "analysis", "wam", "ft_sensor"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / package, tmp_path / package, ignore=ignored)
    return tmp_path


@pytest.mark.parametrize(
    "formula",
    ["gp/kernels.py", "gp/likelihood.py", "tustin/model.py", "data/prepare.py"],
)
def test_a_changed_formula_is_in_the_digest_of_the_folds(copy, formula):
    before = code_digest(FOLDS)
    path = copy / "analysis" / formula
    path.write_text(path.read_text() + "\n")
    assert code_digest(FOLDS, copy) != before


def test_equal_sources_elsewhere_have_an_equal_digest(copy):
    assert code_digest(FOLDS, copy) == code_digest(FOLDS)


def test_what_a_fold_does_not_use_leaves_its_digest(copy):
    for name in ("report/style.py", "report/page.py"):
        path = copy / "analysis" / name
        path.write_text(path.read_text() + "\n")
    assert code_digest(FOLDS, copy) == code_digest(FOLDS)


@pytest.mark.parametrize(
    ("function", "used"),
    [
        (run_fold, "analysis.gp.regression"),
        (fit_terrain, "analysis.tustin.model"),
        (fit_components, "analysis.data.series"),
        (fit_planned, "analysis.study.push_likelihood"),
        (tabulate, "analysis.study.models"),
        (
            report_figures,
            "analysis.report.sections.paper.curves",
        ),  # imported when drawn
        (report_figures, "ft_sensor.payload"),  # through other modules
    ],
)
def test_imports_are_followed_to_their_end(function, used):
    assert {function.__module__, used} <= set(source_files(function.__module__))


PROGRAM = """
import sys
from pathlib import Path

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.tables.loading import load_tables
from analysis.study.crossval import plan_folds, run_fold
from analysis.study.jobs import run_tasks
from analysis.study.models import FitOptions
from analysis.study.store import ResultStore

path, folder = map(Path, sys.argv[1:])
series = load_tables([path])["TF"]
trials = {"TF": [prepare_trial(one, PrepareOptions()) for one in series]}
plan, _ = plan_folds(trials, FitOptions(models=("tustin",)))
made = []
store = ResultStore(folder)
folds = run_tasks(
    run_fold, plan, 1, lambda done, of: made.append(done), store
)
print(len(made), *(fold.models["tustin"].score.mae for fold in folds))
"""


@pytest.mark.slow
def test_a_corrected_formula_is_fitted_anew(copy, tmp_path):
    table = Path(__file__).parents[2] / "data" / "rehearsal_slice.npz"

    def fitted():
        command = [sys.executable, "-c", PROGRAM, str(table), str(tmp_path / "kept")]
        done = subprocess.run(
            command, cwd=copy, capture_output=True, text=True, check=True
        )
        made, *errors = done.stdout.split()
        return int(made), errors

    first, errors = fitted()
    assert first == len(errors) > 1
    assert fitted() == (1, errors)  # one word of progress: all of them are kept
    path = copy / "analysis" / "tustin" / "model.py"
    formula, right = path.read_text(), "stribeck_power(np.abs(v_t), p.v_s,"
    assert right in formula
    path.write_text(formula.replace(right, "stribeck_power(np.abs(v_t), 2 * p.v_s,"))
    again, others = fitted()
    assert again == first
    assert others != errors
