"""A served arm whose commissioning is missing, stale or edited is not driven."""

import json
import os
import pty
import re
import select
import subprocess
import sys

import pytest

from acquisition.clock import SystemClock
from acquisition.errors import TractionError
from experiments.commissioning.evidence.record import NAME
from lab.guest.commissioned import write_passed_commissioning
from tests.experiments.program import changed, served_config, traction

pytestmark = [pytest.mark.wall_clock, pytest.mark.timeout(400)]
TRIES = 6
PATIENCE = 90.0  # s, until a command has ended or asks
ASKS = "Shift-activate"
REFUSED = "This arm is not commissioned"


@pytest.fixture
def config(tmp_path):
    """Settings of a real rig whose bus is served at `tmp_path`/bus."""
    return served_config(tmp_path)


@pytest.fixture(autouse=True)
def served_arm(tmp_path):
    """Serve an arm at home with its sensor."""
    command = [sys.executable, "-m", "experiments", "fake", "--idle-first"]
    command += ["--can", f"traction-fake:{tmp_path}/bus"]
    command += ["--serial", str(tmp_path / "sensor")]
    served = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert served.stdout.readline().startswith("ready")
    yield served
    served.kill()
    served.communicate()


def run_at_terminal(config, data):
    """Run a session at a terminal until it ends or asks for the arm to be activated."""
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "experiments", "run", "TF", "--no-color"]
    process = subprocess.Popen(
        [*command, "--config", str(config), "--data", str(data)],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
    )
    os.close(theirs)
    clock = SystemClock()
    seen, end_ns = "", clock.now_ns() + round(1e9 * PATIENCE)
    try:
        while clock.now_ns() < end_ns and ASKS not in seen:
            if not select.select([ours], [], [], 0.5)[0]:
                continue
            try:
                seen += os.read(ours, 65536).decode(errors="replace")
            except OSError:  # it has ended
                break
    finally:
        process.kill()
        process.wait()
        os.close(ours)
    return re.sub(r"\s+", " ", re.sub(r"\x1b\[[\d;?]*\w", "", seen))


def commissioned(config):
    """Write a record of sound steps next to `config`; repeated on a busy machine."""
    for left in reversed(range(TRIES)):
        try:
            return write_passed_commissioning(config)
        except TractionError:
            if not left:
                raise
    raise AssertionError


def page(config, data):
    """Output of `run` once the arm replies; repeated on a busy machine."""
    for _ in range(TRIES):
        seen = run_at_terminal(config, data)
        if "commission" in seen:
            return seen
    raise AssertionError(seen)


def test_an_arm_without_a_record_is_not_driven(config, tmp_path):
    seen = page(config, tmp_path)
    assert f"{REFUSED}: C0 configuration: not done, and 11 more" in seen
    assert ASKS not in seen


def test_an_arm_with_a_stale_record_is_not_driven(config, tmp_path):
    commissioned(config)
    old, new = "foot_speed = 0.8 ", "foot_speed = 0.7 "
    config.write_text(changed(config.read_text(), old, new))
    seen = page(config, tmp_path)
    assert f"{REFUSED}: C0 configuration: stale: [limits] of rig.toml changed" in seen
    assert ASKS not in seen


def test_an_arm_with_an_edited_record_is_not_driven(config, tmp_path):
    commissioned(config)
    path = config.parent / NAME
    content = json.loads(path.read_text())
    content["steps"][8]["operator"] = "another"
    path.write_text(json.dumps(content))
    seen = page(config, tmp_path)
    assert "was changed at or before C8 rest pose" in seen
    assert ASKS not in seen


def zeroed(config):
    """Zero the served arm, which is at home; repeated on a busy machine."""
    for _ in range(TRIES):
        done = traction("zero", "--yes", "--config", config)
        if done.code == 0:
            return
    raise AssertionError(done.err)


def test_an_arm_with_a_sound_record_is_driven(config, tmp_path):
    zeroed(config)
    commissioned(config)
    for _ in range(TRIES):
        seen = run_at_terminal(config, tmp_path)
        if ASKS in seen:
            break
    assert "uncommissioned: C12 lock and clock: not done" in seen
    assert ASKS in seen
    assert REFUSED not in seen
