"""Shards of a study: runs that know nothing of each other, by one store."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.series import TractionSeries
from analysis.study.jobs import Batch, Shard, run_batches, run_shard
from analysis.study.models import GP_SE_TRIAL, TUSTIN, FitOptions
from analysis.study.store import ResultStore, encode
from analysis.study.study import StudyOptions, run_study, run_study_shard

ROOT = Path(__file__).parents[3]
SHARDS, KILLED = 8, (3, 6)
FEW = StudyOptions(fit=FitOptions(gp_points=60, models=(TUSTIN, GP_SE_TRIAL), draws=2))
# One run of an array job: says when a result is kept, and then takes the next one.
JOB = """import sys
from dataclasses import replace
from pathlib import Path
from analysis.study.jobs import Shard
from analysis.study.store import ResultStore
from analysis.study.study import run_study_shard
from tests.analysis.study.test_shards import FEW, SHARDS, trials_of

def told(done, total):
    print(done, total, flush=True)
    sys.stdin.readline()

run_study_shard(
    trials_of(16),
    replace(FEW, n_jobs=1),
    Shard(int(sys.argv[1]), SHARDS),
    ResultStore(Path(sys.argv[2])),
    told,
)
"""


def started(number, folder):
    """Return a process that does one shard and waits after every result."""
    return subprocess.Popen(
        [sys.executable, "-c", JOB, str(number), str(folder)],
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def trials_of(count):
    found = []
    for k in range(count):
        rng = np.random.default_rng(k)
        t = 0.002 * np.arange(3000.0)
        v_t = 0.06 + 0.05 * np.sin(3.0 * t + k)
        F_n = 4.0 + 2.0 * np.sin(2.0 * t + 2 * k)
        F_t = 0.6 * F_n + 0.3 * k + rng.normal(0, 0.3, t.size)
        found.append(TractionSeries("S0", f"T{k}", t, v_t, F_n, F_t))
    return {"S0": found}


def doubled(task):
    return 2 * task


def test_all_shards_together_do_every_task_once(tmp_path):
    store, batches = ResultStore(tmp_path), [Batch(doubled, [3, 5, 8, 13, 21])]
    counts = [run_shard(batches, Shard(k, 2), store, 1) for k in (1, 2)]
    assert counts == [3, 2]
    assert [store.get(doubled, task) for task in (3, 5, 8, 13, 21)] == [
        6, 10, 16, 26, 42,
    ]  # fmt: skip


@pytest.mark.parametrize("number", [0, 4])
def test_a_shard_is_one_of_so_many(number):
    with pytest.raises(SettingsError, match=f"no shard {number} of 3"):
        Shard(number, 3)


@pytest.mark.slow
def test_shards_of_which_one_was_killed_equal_one_run_bit_for_bit(tmp_path):
    trials = trials_of(4)
    options = StudyOptions(
        fit=FitOptions(models=(TUSTIN, GP_SE_TRIAL), draws=3), n_jobs=1
    )
    alone = run_study(trials, options, True, store=ResultStore(tmp_path / "one"))
    shared = tmp_path / "shards"
    for number in (3, 1, 2):
        run_study_shard(trials, options, Shard(number, 3), ResultStore(shared))
    for killed in sorted(shared.glob("*.json"))[::5]:
        killed.unlink()
    for number in (1, 2, 3):
        run_study_shard(trials, options, Shard(number, 3), ResultStore(shared))

    def report(done):
        made = done.terrains["S0"]
        return encode([made.folds, made.whole, made.components])

    before = {path.name: path.stat().st_size for path in shared.glob("*.json")}
    together = run_study(trials, options, True, store=ResultStore(shared))
    assert report(together) == report(alone)
    assert {p.name: p.stat().st_size for p in shared.glob("*.json")} == before
    assert set(before) == {p.name for p in (tmp_path / "one").glob("*.json")}


def test_without_a_store_batches_are_done_as_before():
    assert run_batches([Batch(doubled, [1, 2])], 1) == [[2, 4]]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_processes_killed_in_the_middle_and_started_again_lose_nothing(tmp_path):
    shared, alone = tmp_path / "shards", tmp_path / "one"
    for number in range(1, SHARDS + 1):
        with started(number, shared) as job:
            if number in KILLED:
                done, total = map(int, job.stdout.readline().split())
                assert done < total
                job.send_signal(signal.SIGKILL)
            else:
                job.communicate("\n" * 20)
        assert job.returncode == (-signal.SIGKILL if number in KILLED else 0)
    left = {path.name: path.read_bytes() for path in shared.glob("*.json")}
    for number in KILLED:
        with started(number, shared) as job:
            job.communicate("\n" * 20)
        assert job.returncode == 0
    run_study(trials_of(16), FEW, True, store=ResultStore(alone))
    together = {path.name: path.read_bytes() for path in shared.glob("*.json")}
    assert left.items() < together.items()
    assert together == {path.name: path.read_bytes() for path in alone.glob("*.json")}
