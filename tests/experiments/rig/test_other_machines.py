"""A machine that is not x86 runs simulations in one thread only."""

import platform

import pytest

from tests.experiments.program import traction


@pytest.fixture(autouse=True)
def on_arm(monkeypatch):
    monkeypatch.setattr(platform, "machine", lambda: "aarch64")


def test_processes_are_refused(config, tmp_path):
    options = ("--fake", "--processes", "--config", config, "--data", tmp_path)
    done = traction("check", *options)
    assert done.code == 3
    assert "aarch64" in done.err


@pytest.mark.slow
def test_a_simulation_in_one_thread_runs(config, tmp_path):
    options = ("--fake", "--config", config, "--data", tmp_path)
    assert traction("check", *options).code == 0
