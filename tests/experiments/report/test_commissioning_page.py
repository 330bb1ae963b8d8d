"""The page of a commissioning shows what its record says."""

from datetime import UTC, datetime, timedelta

import pytest

from analysis.report.limit_page import LimitedValue
from experiments.commissioning.record import Commissioning, Measured, StepRecord
from experiments.commissioning.steps import ProofStep
from experiments.report.commissioning import write_page

NOON = datetime(2026, 11, 26, 12, tzinfo=UTC)


def record(value, day=0, cause=""):
    ended = NOON + timedelta(days=day)
    done = StepRecord(
        step=ProofStep.BY_HAND,
        started=ended,
        ended=ended,
        operator="Ada <A>",
        witness="Grace",
        inputs={},
        quantities=(
            Measured(name="travel of joint 2", value=value, unit="%", low=-2, high=2),
        ),
        verdict="wrong" if cause else "sound",
        cause=cause,
    )
    return Commissioning(program="0.3.0").with_step(done)


def test_values_limits_persons_and_what_lacks_stand_on_the_page(tmp_path):
    text = write_page(tmp_path, record(1.25), ["C6 own weight: not done"]).read_text()
    for words in ("travel of joint 2", "1.25", "Ada &lt;A&gt; with Grace", "12:00"):
        assert words in text
    assert "C6 own weight: not done" in text
    assert "earlier" not in text.split("<main>")[1]
    assert "<svg" in text


def test_an_earlier_one_stands_beside_it(tmp_path):
    earlier = record(-0.75)
    text = write_page(tmp_path, record(1.25, day=20), [], earlier).read_text()
    assert "Drawn beside the commissioning of 2026-11-26 12:00 UTC" in text
    assert "\u22120.75" in text


def test_what_failed_is_told_with_its_cause(tmp_path):
    text = write_page(tmp_path, record(3.5, cause="It goes further."), []).read_text()
    assert "wrong, 2026-11-26 12:00 UTC" in text
    assert "It goes further." in text
    assert ">beyond<" in text


@pytest.mark.parametrize(
    ("low", "high", "value", "share"),
    [
        (-2.0, 2.0, 1.0, 0.5),
        (16.0, 28.0, 28.0, 1.0),
        (None, 8.0, 2.0, 0.25),
        (0.75, None, 1.5, 0.5),
        (7.0, 7.0, 7.0, None),
        (None, 0.0, 0.0, None),
    ],
)
def test_a_value_is_drawn_as_a_share_of_its_limit(low, high, value, share):
    assert LimitedValue("one", value, "", low, high).share(value) == share
