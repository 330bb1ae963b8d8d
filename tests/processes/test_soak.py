"""The loop and its recorder run for minutes, and notice an arm that is taken."""

import json
import os
import subprocess
import sys
import threading
from contextlib import closing

import can
import pytest

from experiments.preflight.loop_benchmark import run_bench
from experiments.preflight.preflight import start_devices
from experiments.rig.rig import FakeOptions, build_rig
from experiments.settings.load import load_settings
from fakes.bus.client import SocketBus
from tests.processes.watching import ROOT, START, children_of

pytestmark = [pytest.mark.wall_clock, pytest.mark.timeout(700)]
GROWTH_KB = 1024  # per process, second half of the time
SECONDS = 5.0
LATER = 4.0  # s, of which the arm is held for one; fewer cycles show no period
TORQUES = can.Message(arbitration_id=0x404, data=bytes(8), is_extended_id=False)


@pytest.mark.parametrize("seconds", [30, pytest.param(600, marks=pytest.mark.long)])
def test_no_recorded_cycle_is_lost_and_memory_does_not_grow(tmp_path, seconds):
    command = [sys.executable, "-c", START, "bench", "--fake", "--json"]
    done = subprocess.run(
        [*command, "--seconds", str(seconds)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=seconds + 80,
    )
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["lost"] == 0
    # stalls of the machine may cost cycles, never more than one in a hundred
    assert report["recorded"] >= 0.99 * seconds * 500
    assert report["is_powered"]
    for use in report["processes"]:
        assert use["growth_kb"] <= GROWTH_KB, use
    assert not {"traction-contro", "traction-record"} & set(children_of(1))


def test_bench_reports_an_arm_that_another_master_takes():
    settings = load_settings(None)
    rig = build_rig(
        settings, settings.matrix.terrains[0], FakeOptions("processes", seed=1)
    )
    with closing(rig.backend) as backend:
        start_devices(rig)
        processes = {**backend.processes(), "console": os.getpid()}
        with SocketBus(backend.bus_path) as other:
            timer = threading.Timer(LATER, other.send, [TORQUES])
            timer.start()
            report = run_bench(rig, processes, SECONDS)
            timer.join()
    assert not report.is_powered
    assert "404" in report.fault
    assert report.as_dict()["fault"] == report.fault
