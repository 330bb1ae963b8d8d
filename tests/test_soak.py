"""A minute of the soak: the same program, checked after every session."""

import pytest

from tests.soak import soaked, summary

MINUTE = 1 / 60  # h, simulated

pytestmark = [pytest.mark.long, pytest.mark.timeout(300)]


def test_a_simulated_minute_with_faults_passes_every_check(tmp_path):
    seen = []
    soak = soaked(MINUTE, seed=1, folder=tmp_path, report=seen.append)
    assert soak.simulated_ns >= MINUTE * 3.6e12
    assert soak.counts["sessions"] == len(seen) >= 2
    assert soak.counts["checks of files"] > soak.counts["trials"]
    assert summary(soak)
