"""The process that drives the arm keeps the processors from sleeping."""

import os
from pathlib import Path

import pytest

from experiments.rig.requests import StartArm
from experiments.rig.rig import FakeOptions, build_rig
from experiments.settings.load import load_settings

pytestmark = pytest.mark.wall_clock
LATENCY = Path("/dev/cpu_dma_latency")


def holders():
    """Processes that hold the kernel's guarantee of short wake-ups."""
    pids = set()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            opened = [path.readlink() for path in (process / "fd").iterdir()]
        except OSError:
            continue  # another user's, or gone
        if LATENCY in opened:
            pids.add(int(process.name))
    return pids


@pytest.mark.skipif(not os.access(LATENCY, os.W_OK), reason="it may not be asked for")
def test_one_process_keeps_the_processors_awake_until_it_ends():
    before = holders()
    settings = load_settings(None)
    rig = build_rig(settings, settings.row("S0"), FakeOptions("processes", seed=1))
    try:
        rig.backend.ask(StartArm())
        grants = [grant for group in rig.backend.grants().values() for grant in group]
        asked = [grant.is_granted for grant in grants if "awake" in grant.what]
        assert asked == [True]
        (holder,) = holders() - before
        assert holder != os.getpid()
    finally:
        rig.backend.close()
    assert holders() == before
