"""A killed study resumes from its stored results."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from analysis.data.series import TractionSeries
from analysis.study.models import GP_SE_TRIAL, TUSTIN, FitOptions
from analysis.study.store import ResultStore
from analysis.study.study import StudyOptions, run_study

ROOT = Path(__file__).parents[3]
OPTIONS = StudyOptions(
    fit=FitOptions(gp_points=60, models=(TUSTIN, GP_SE_TRIAL), draws=2), n_jobs=1
)
# Reports each stored result, and waits for a line before the next one.
STUDY = """import sys
from pathlib import Path
from analysis.study.store import ResultStore
from analysis.study.study import run_study
from tests.analysis.study.test_resuming import OPTIONS, made_trials

def report(done, total):
    print(done, total, flush=True)
    sys.stdin.readline()

run_study(made_trials(4), OPTIONS, True, report, ResultStore(Path(sys.argv[1])))
"""


def made_trials(count):
    trials = []
    for k in range(count):
        rng = np.random.default_rng(k)
        t = 0.002 * np.arange(3000.0)
        v_t = 0.06 + 0.05 * np.sin(3.0 * t + k)
        F_n = 4.0 + 2.0 * np.sin(2.0 * t + 2 * k)
        F_t = 0.6 * F_n + 0.3 * k + rng.normal(0, 0.3, t.size)
        trials.append(TractionSeries("S0", f"T{k}", t, v_t, F_n, F_t))
    return {"S0": trials}


def started(folder):
    """Return a process that waits after every result."""
    return subprocess.Popen(
        [sys.executable, "-c", STUDY, str(folder)],
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.json")}


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_resumed_study_equals_an_uninterrupted_one(tmp_path):
    resumed, alone = tmp_path / "resumed", tmp_path / "alone"
    with started(resumed) as study:
        study.stdout.readline()
        study.stdin.write("\n")
        study.stdin.flush()
        done, total = map(int, study.stdout.readline().split())
        study.send_signal(signal.SIGKILL)
    assert study.returncode == -signal.SIGKILL
    assert done == 2 < total
    kept = contents(resumed)
    with started(resumed) as study:
        seen, _ = study.communicate("\n" * 20)
    assert seen.split()[0] == str(len(kept))  # loaded at once, with one progress report
    run_study(made_trials(4), OPTIONS, True, store=ResultStore(alone))
    assert kept.items() < contents(resumed).items()
    assert contents(resumed) == contents(alone)
