"""A failed check does not hide the next one."""

import pytest

from experiments.operator.console import BAD, GOOD, WARNING
from experiments.preflight import host_checks
from experiments.preflight.host_checks import check_interface
from tests.experiments.program import run_short, write_config
from wam.bus.socketcan import LONGEST_QUEUE, InterfaceState


def marks(done):
    lines = [line.split() for line in done.out.splitlines()]
    return {words[1]: words[0] for words in lines if words and words[0] in {GOOD, BAD}}


def refused(tmp_path, *names):
    faults = [word for name in names for word in ("--fault", name)]
    config = write_config(tmp_path)
    return run_short(config, tmp_path / "data", "TF", 1, *faults)


def test_disk_arm_and_sensor_are_all_graded(tmp_path):
    done = refused(tmp_path, "disk-full@T0+0s", "puck-missing", "ft-silent")
    assert done.code == 3
    graded = marks(done)
    assert [graded[name] for name in ("disk", "arm", "F/T")] == [BAD, BAD, BAD]
    assert "GB free; a session needs" in done.err  # the first of them
    assert done.out.count("Also: ") == 2
    assert "idle" not in done.out + done.err  # the state of a silent arm is unknown


def test_an_arm_that_is_not_zeroed_is_checked_further(tmp_path):
    done = refused(tmp_path, "not-zeroed")
    graded = marks(done)
    assert (graded["zero"], graded["exchange"], graded["F/T"]) == (BAD, GOOD, GOOD)
    assert "Also: " not in done.out
    assert "not zeroed" in done.err


def test_no_loop_runs_after_a_refusal(tmp_path):
    assert "loop" not in marks(refused(tmp_path, "ft-silent"))


def test_the_bus_is_reported_with_its_transport(tmp_path):
    done = refused(tmp_path, "not-zeroed")
    assert "simulated, python-can" in done.out


@pytest.mark.parametrize(
    ("state", "mark", "word"),
    [
        (InterfaceState(True, True, 10), GOOD, "10 frames"),
        (InterfaceState(True, True, LONGEST_QUEUE), GOOD, "is up"),
        (InterfaceState(True, True, 1000), WARNING, "txqueuelen 16"),
        (InterfaceState(True, False, 10), WARNING, "down, then up"),
        (InterfaceState(False, False, 10), WARNING, "is down"),
    ],
)
def test_the_interface_of_the_kernel_is_graded(monkeypatch, state, mark, word):
    monkeypatch.setattr(host_checks, "interface_state", lambda _: state)
    result = check_interface("can0")
    assert result is not None
    assert result.mark == mark
    assert word in result.text


def test_a_missing_interface_is_left_to_the_check_of_the_arm():
    assert check_interface("nocan17") is None
