"""A fault after a fault: pairs that differ in kind; all: `-m tests.faults.pairs`."""

import pytest

from tests.experiments.program import write_config
from tests.faults.pairs import DELAYS_MS, PHASES, STRIKES, Pair, problems_of
from tests.faults.phases import MOVING

DAILY = (
    # What only holds, then what idles.
    Pair("ft-stale", "pendant-idle", 100, "recording"),
    Pair("console-silent", "bus-shared", 60, "ready"),
    Pair("contact-force", "estop", 140, "recording"),
    Pair("move-refused", "position-jump", 60, "tare"),
    # What damps, then what idles, and the other way round.
    Pair("overspeed", "pendant-idle", 100, "recording"),
    Pair("pendant-idle", "overspeed", 20, "recording"),
    # What idles, then what only holds.
    Pair("estop", "console-silent", 20, "review"),
    # What holds and would idle later, beside another that does.
    Pair("move-refused", "can-silence", 0, "review"),
    # While the arm moves by itself.
    Pair("joint-limit", "puck-silent", 20, MOVING),
)


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    return write_config(tmp_path_factory.mktemp("config"))


@pytest.mark.parametrize("pair", DAILY, ids=str)
def test_two_faults_come_to_what_the_stricter_one_does(pair, config, tmp_path):
    assert problems_of(pair, config, tmp_path / "data") == []


def test_the_daily_pairs_are_of_the_table():
    for pair in DAILY:
        assert {pair.first, pair.second} <= set(STRIKES)
        assert pair.delay_ms in DELAYS_MS
        assert pair.phase in PHASES
