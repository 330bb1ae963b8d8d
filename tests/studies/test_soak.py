"""A minute of the soak: the same program, checked after every session."""

import json

import pytest

from studies.soak import page, recorder, soaked, summary

MINUTE = 1 / 60  # h, simulated

pytestmark = [pytest.mark.long, pytest.mark.timeout(300)]


def test_a_simulated_minute_with_faults_keeps_every_promise(tmp_path):
    said = []
    record = recorder(tmp_path / "record.json", 1)

    def tell(soak):
        said.append(soak)
        record(soak)

    soak = soaked(MINUTE, seed=1, folder=tmp_path, tell=tell)
    assert soak.simulated_ns >= MINUTE * 3.6e12
    assert soak.counts["sessions"] == len(said) >= 2
    assert soak.counts["checks of files"] > soak.counts["trials"]
    assert summary(soak)
    written = json.loads((tmp_path / "record.json").read_text())
    assert written["hours"] == pytest.approx(soak.simulated_ns / 3.6e12, abs=1e-3)
    assert written["counts"]["sessions"] == len(said)


def test_the_page_adds_up_its_runs():
    counts = {"sessions": 3, "trials": 9, "fault estop": 2, "fault ft-stale": 1}
    fields = {"seed": 1, "commit": "abc", "date": "2026-01-01", "hours": 1.25}
    record = {
        **fields,
        "counts": counts,
        "descriptors": [6, 6],
        "memory_kb": [1e5, 1.1e5],
    }

    text = page([record, {**record, "hours": 2.5}]).replace("\n", " ")

    assert "3.8 simulated hours in 2 processes" in text
    row = "| 1 | abc | 2026-01-01 | 1.25 | 3 | 9 | 3 | 0 | 6, 6 | 100.0, 110.0 |"
    assert row in text
