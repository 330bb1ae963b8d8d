"""Tasks on a real Dask cluster of two workers on loopback, one of which is killed."""

import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from acquisition.errors import SettingsError
from analysis.study.cluster import is_guarded
from analysis.study.fits import to_fits
from analysis.study.models import FitOptions
from analysis.study.study import StudyOptions, run_study
from analysis.study.tasks import Workers, run_tasks
from analysis.study.worker_processes import WorkerLostError

ROOT = Path(__file__).parents[3]
FIT = FitOptions(gp_points=60, draws=5, models=("tustin", "gp_se"))


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def cluster(tmp_path):
    """Return the scheduler's address and its two workers, in a folder of their own."""
    address = f"tcp://127.0.0.1:{free_port()}"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    started = []

    def start(module, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments]
        started.append(
            subprocess.Popen(
                command,
                cwd=tmp_path,
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        )
        return started[-1]

    start("dask_scheduler", "--host", address, "--no-dashboard", "--no-jupyter")
    own = ("--no-nanny", "--no-dashboard", "--nthreads", "1", "--host", "127.0.0.1")
    workers = [start("dask_worker", address, *own) for _ in range(2)]
    yield address, workers
    for process in reversed(started):
        process.kill()
        process.wait(10)


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_killed_worker_changes_nothing(cluster, slice_trials):
    address, workers = cluster
    killed = threading.Event()

    def kill_one(done, total):
        if done == 3 and not killed.is_set():
            workers[0].send_signal(signal.SIGKILL)
            killed.set()

    there = StudyOptions(fit=FIT, scheduler=address)
    remote = to_fits(run_study(slice_trials, there, True, kill_one))
    local = to_fits(run_study(slice_trials, StudyOptions(fit=FIT, n_jobs=1), True))
    assert killed.is_set()
    remote["options"] = local["options"] = None
    assert remote == local


def end_at_three(number):
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_task_that_kills_its_workers_is_reported_at_once():
    import dask
    from distributed import LocalCluster

    quick = {"distributed.scheduler.allowed-failures": 0}
    local = {"host": "127.0.0.1", "dashboard_address": None, "silence_logs": 50}
    with (
        dask.config.set(quick),
        LocalCluster(n_workers=2, threads_per_worker=1, **local) as cluster,
    ):
        workers = Workers(scheduler=cluster.scheduler_address)
        with pytest.raises(WorkerLostError, match="ended unexpectedly"):
            run_tasks(end_at_three, [1, 2, 3, 4, 5], workers)


@pytest.mark.parametrize(
    "address",
    [
        "tcp://192.168.1.5:8786",
        "192.168.1.5:8786",
        "tcp://localhost.evil.example:8786",
        "ws://127.0.0.1:8786",
        "tcp://[fe80::1]:8786",
        "tcp://",
    ],
)
def test_a_scheduler_elsewhere_is_refused_without_tls(address):
    with pytest.raises(SettingsError, match="TLS"):
        run_tasks(abs, [1, 2], Workers(scheduler=address))


@pytest.mark.parametrize(
    "address",
    ["tcp://127.0.0.1:8786", "localhost:8786", "tcp://[::1]:8786", "tls://lab:8786"],
)
def test_a_scheduler_on_this_machine_or_by_tls_is_accepted(address):
    assert is_guarded(address)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_missing_scheduler_is_reported():
    address = f"tcp://127.0.0.1:{free_port()}"
    with pytest.raises(SettingsError, match=address):
        run_tasks(abs, [1, 2], Workers(scheduler=address))
