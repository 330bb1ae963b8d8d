"""The screen of a running trial."""

from types import SimpleNamespace

import numpy as np

from acquisition.ipc.commands import LoopStatus
from acquisition.sample import CYCLE
from experiments.run.record import recording_screen
from experiments.session.sidecar import TrialOutcome
from experiments.settings.load import load_settings


def test_missed_counts_the_skipped_cycles_of_the_trial_and_no_late_ones():
    status = LoopStatus(skipped=4, late=9)
    samples = np.zeros(600, CYCLE.dtype)
    samples["host_ns"] = np.arange(600) * 2_000_000
    loop_client = SimpleNamespace(loop=status, last=lambda seconds: samples)
    rig = SimpleNamespace(
        backend=SimpleNamespace(loop_client=loop_client),
        settings=load_settings(None),
        frame=SimpleNamespace(travel=0.45),
    )
    lines = recording_screen(rig, "T04", TrialOutcome("", 1.0, 0.1))
    assert "missed 0" in lines(80)[0]
    status.late += 5
    assert "missed 0" in lines(80)[0]
    status.skipped += 2
    assert "missed 2" in lines(80)[0]
