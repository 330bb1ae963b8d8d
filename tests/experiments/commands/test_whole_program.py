"""The program in a separate process, and its report."""

import json
import signal
import subprocess
import sys

import pytest

from acquisition.trial_file.verify import verify_file
from tests.experiments.program import journal, only_session, sidecar, traction

pytestmark = [pytest.mark.long, pytest.mark.timeout(300)]


def start(config, data, *more):
    """Start a simulated session; its process."""
    options = ("--fake", "--fast", "--trials", "9", "--config", config, "--data", data)
    return subprocess.Popen(
        [
            sys.executable,
            "-m",
            "experiments",
            "run",
            "TF",
            *map(str, (*options, *more)),
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for(process, text):
    for line in process.stdout:
        if text in line:
            return
    pytest.fail(f"the session ended without saying {text!r}")


def test_ctrl_c_in_a_running_trial_closes_it_and_keeps_the_earlier_one(
    config, tmp_path
):
    with start(config, tmp_path) as process:
        wait_for(process, "trial 2 of 9")
        wait_for(process, "foot at the far end")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (5, "")
    assert out.splitlines()[-2] == "ARM: idle; it sinks slowly, support it."
    folder = only_session(tmp_path)
    path = folder / "trials" / "T01.mcap"
    assert verify_file(path).sha256 == sidecar(path)["sha256"]
    assert journal(folder)[-1]["reason"] == "unfinished"
    assert not list(folder.rglob("*.partial"))


def test_a_closed_output_ends_the_session_unfinished(config, tmp_path):
    with start(config, tmp_path) as process:
        wait_for(process, "trial 1 of 9")
        process.stdout.close()
        assert process.wait(timeout=60) == 5
    assert journal(only_session(tmp_path))[-1]["reason"] == "unfinished"


def test_a_killed_session_leaves_the_earlier_trial_intact(config, tmp_path):
    with start(config, tmp_path) as process:
        wait_for(process, "trial 2 of 9")
        process.kill()
        process.wait(timeout=60)
    path = only_session(tmp_path) / "trials" / "T01.mcap"
    assert verify_file(path).sha256 == sidecar(path)["sha256"]


def test_a_report_is_marked_as_simulated_and_compares_with_the_truth(
    recorded,
):
    done = traction("report", "S001", "--data", recorded.data)
    assert done.code == 0
    page = recorded.folder / "report" / "index.html"
    assert done.out.splitlines()[-1] == f"Open in a browser: {page}"
    text = page.read_text()
    assert "SIMULATED" in text
    assert "Measured against true" in text
    assert json.loads((recorded.folder / "fits.json").read_text())
