"""A corrected formula never returns a stale result: results are keyed by their code."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.study.store import code_digest

ROOT = Path(__file__).parents[3]


@pytest.fixture
def copy(tmp_path):
    """The sources, copied to where they may be changed."""
    for package in ("acquisition", "analysis", "wam", "ft_sensor"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / package, tmp_path / package, ignore=ignored)
    return tmp_path


def digests(root):
    """Return the digests of the code behind fits and behind figures."""
    code_digest.cache_clear()
    return code_digest(root), code_digest(root, is_drawn=True)


@pytest.mark.parametrize(
    "formula",
    ["gp/kernels.py", "tustin/model.py", "data/prepare.py", "study/push_likelihood.py"],
)
def test_a_changed_formula_changes_the_digests_of_fits_and_figures(copy, formula):
    before = digests(copy)
    path = copy / "analysis" / formula
    path.write_text(path.read_text() + "\n")
    fits, figures = digests(copy)
    assert fits != before[0]
    assert figures != before[1]


@pytest.mark.parametrize(
    "module",
    [
        "analysis/report/style.py",
        "analysis/report/sections/paper/curves.py",
        "ft_sensor/payload.py",
    ],
)
def test_code_used_only_by_figures_does_not_change_the_fit_digest(copy, module):
    before = digests(copy)
    path = copy / module
    path.write_text(path.read_text() + "\n")
    fits, figures = digests(copy)
    assert fits == before[0]
    assert figures != before[1]


def test_equal_sources_elsewhere_have_equal_digests(copy):
    assert digests(copy) == digests(ROOT)


def test_the_fit_digest_covers_every_import_of_fits():
    modules = (
        "analysis.study.break_away_fit, analysis.study.covariates, "
        "analysis.study.crossval, analysis.study.terrain_fit, "
        "analysis.study.trial_components"
    )
    code = f"import sys, {modules}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    loaded = done.stdout.split()
    assert "analysis.study.crossval" in loaded
    outside = (
        "analysis.report",
        "experiments",
        "fakes",
        "ft_sensor",
        "traction",
        "wam",
    )
    assert [name for name in loaded if name.startswith(outside)] == []


PROGRAM = """
import sys
from pathlib import Path

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.tables.loading import load_tables
from analysis.study.crossval import plan_folds, run_fold
from analysis.study.tasks import run_tasks
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
def test_a_corrected_formula_is_refitted(copy, tmp_path):
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
    assert fitted() == (1, errors)  # one progress call: all are stored
    path = copy / "analysis" / "tustin" / "model.py"
    formula, correct = path.read_text(), "stribeck_power(np.abs(v_t), p.v_s,"
    assert correct in formula
    path.write_text(formula.replace(correct, "stribeck_power(np.abs(v_t), 2 * p.v_s,"))
    again, others = fitted()
    assert again == first
    assert others != errors
