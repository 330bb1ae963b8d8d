"""Minutes of the loop with its recorder: nothing is lost and nothing grows."""

import json
import subprocess
import sys

import pytest

from tests.processes.watching import ROOT, START, children_of

pytestmark = [pytest.mark.wall_clock, pytest.mark.timeout(700)]
GROWTH_KB = 1024  # per process, second half of the time


@pytest.mark.parametrize("seconds", [30, pytest.param(600, marks=pytest.mark.long)])
def test_nothing_is_lost_and_memory_stays(tmp_path, seconds):
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
