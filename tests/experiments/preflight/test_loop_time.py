"""The preflight measures the loop for the configured or the requested time."""

import re
from dataclasses import replace

import pytest

from experiments.operator.console import Console
from experiments.preflight.preflight import run_preflight
from experiments.rig.bus_log import logging_bus
from experiments.rig.rig import FakeOptions, build_rig
from experiments.settings.load import load_settings
from experiments.settings.rig import LoopSection


def measured(tmp_path, capsys, *seconds):
    """Time for which the loop was measured [s] with `test_time = 0.7`."""
    given = load_settings(None)
    loop = given.rig.loop.model_copy(update={"test_time": 0.7})
    settings = replace(given, rig=given.rig.model_copy(update={"loop": loop}))
    rig = build_rig(settings, settings.matrix.terrains[0], FakeOptions("fast", seed=1))
    # Simulated time, but as long as on the wall clock.
    rig = replace(rig, pace=None)
    console = Console(color=False)
    with logging_bus(rig, None, console):
        run_preflight(rig, tmp_path, console, *seconds)
    return float(re.search(r"loop ([\d.]+) s", capsys.readouterr().out)[1])


def test_the_loop_is_measured_for_the_time_of_rig_toml(tmp_path, capsys):
    assert measured(tmp_path, capsys) == 0.7


def test_a_command_may_set_another_time(tmp_path, capsys):
    assert measured(tmp_path, capsys, 0.6) == 0.6


@pytest.mark.parametrize("seconds", [0.0, 0.49, -1.0])
def test_too_short_a_time_is_refused(seconds):
    with pytest.raises(ValueError, match="test_time"):
        LoopSection(test_time=seconds)
