"""Two clocks in a log are refused unless one is stated, and then read correctly."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.logs.clocks import doubts_of_clock, fit_clock
from analysis.logs.importing import import_log
from tests.analysis.logs.gantry import StrokeLog, import_request, write_bag2, write_urdf


@pytest.fixture
def imported(tmp_path):
    urdf = write_urdf(tmp_path)

    def make(stroke_log, **options):
        log = tmp_path / "log"
        if not log.exists():
            write_bag2(log, stroke_log)
        return import_log(import_request(stroke_log, log, urdf, **options))

    return make


def fastest(found):
    return float(np.quantile(found.trials[0].traction[:, 0], 0.999))


@pytest.mark.parametrize(
    "rate", [0.8, *(pytest.param(rate, marks=pytest.mark.slow) for rate in (0.5, 2.0))]
)
def test_stamps_at_another_rate_are_refused_until_a_clock_is_stated(imported, rate):
    stroke_log = StrokeLog(stamp_rate=rate)
    with pytest.raises(SettingsError, match=rf"run at {rate:g} times") as error:
        imported(stroke_log)
    assert "--clock receipt" in error.value.hint
    assert fastest(imported(stroke_log, clock="receipt")) == pytest.approx(
        0.06, abs=2e-3
    )


@pytest.mark.slow
def test_a_stated_clock_is_used_and_the_doubt_reported(imported):
    stroke_log = StrokeLog(stamp_rate=0.8)
    spans = [(3.0 * 0.8, 11.0 * 0.8)]
    found = imported(stroke_log, clock="stamp", trials=spans, tare=(0.1, 0.45))
    assert fastest(found) == pytest.approx(0.06 / 0.8, abs=2e-3)
    assert any("run at 0.8 times" in text for text in found.warnings)


@pytest.mark.slow
def test_a_sensor_clock_that_runs_fast_is_reported_with_its_drift(imported):
    stroke_log = StrokeLog(clock_rate=1.001)
    with pytest.raises(SettingsError, match=r"drift \+1000 ppm, 12 ms over the log"):
        imported(stroke_log)
    found = imported(stroke_log, clock="receipt", lag=0.0)
    v_t, F_t, F_n = stroke_log.truth(found.trials[0].t + found.trials[0].start)
    calm = v_t > 0.03
    rest = found.trials[0].traction[calm] - np.column_stack([v_t, F_t, F_n])[calm]
    assert np.sqrt(np.mean(rest[:, 2] ** 2)) < 0.15


def test_offset_clocks_are_refused_with_both_remedies(imported):
    stroke_log = StrokeLog(clock_offset=0.3)
    with pytest.raises(SettingsError, match="stamped 309 ms later") as error:
        imported(stroke_log)
    assert "Or state --lag 309." in error.value.hint
    by_lag = imported(stroke_log, lag=0.31)
    assert not any("two clocks" in text for text in by_lag.warnings)
    v_t, _, F_n = stroke_log.truth(by_lag.trials[0].t + by_lag.trials[0].start)
    rest = (by_lag.trials[0].traction[:, 2] - F_n)[v_t > 0.03]
    assert np.sqrt(np.mean(rest**2)) < 0.1


@pytest.mark.parametrize("step", [0.05, -0.5])
def test_a_clock_set_during_the_log_is_refused(imported, step):
    def change(rows):
        for _, received, message in rows:
            stamp = message.header.stamp
            ns = stamp.sec * 10**9 + stamp.nanosec
            if received - rows[0][1] > 6 * 10**9:
                ns += round(step * 1e9)
            stamp.sec, stamp.nanosec = divmod(ns, 10**9)
        return rows

    stroke_log = StrokeLog(changes=(change,))
    with pytest.raises(SettingsError, match=rf"jump by {step * 1e3:.0f} ms"):
        imported(stroke_log)
    # no line leads from these stamps to the recorder, and it received in bursts
    with pytest.raises(SettingsError, match="which does not distinguish the messages"):
        imported(stroke_log, clock="receipt")


def test_a_large_clock_offset_is_reported(imported):
    with pytest.raises(SettingsError, match=r"stamped -18000\.0 s later"):
        imported(StrokeLog(clock_offset=-18_000.0))


def test_without_stamps_the_clock_must_be_stated(imported):
    stroke_log = StrokeLog(stamps=False)
    with pytest.raises(SettingsError, match="stamps of /joint_states are not set"):
        imported(stroke_log)
    found = imported(stroke_log, clock="receipt")
    assert found.wrench.clock.by == "receipt"
    assert any("times of receipt, without its stamps" in w for w in found.warnings)


def test_topics_without_common_time_are_refused_with_both_spans(imported):
    stroke_log = StrokeLog(clock_offset=-18_000.0)
    with pytest.raises(SettingsError, match=r"the joints go from 0 to 12"):
        imported(stroke_log, clock="stamp")


@pytest.mark.parametrize("clock", [None, "receipt"])
def test_a_few_messages_without_a_stamp_are_omitted(imported, clock):
    """A simulation begins at 0 s."""

    def change(rows):
        for _, _, message in rows[:3]:
            message.header.stamp.sec = message.header.stamp.nanosec = 0
        return rows

    found = imported(StrokeLog(changes=(change,)), clock=clock)
    left_out = [topic.clock.left_out for topic in (found.joints, found.wrench)]
    assert sum(counts.get("without a stamp", 0) for counts in left_out) == 3


def times(*, drift=0.0, step=0.0, stall=0.0, seed=1):
    """Return stamps and receipts [ns] of 20 s at 500 Hz with delays of 0 to 5 ms."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 20.0, 0.002)
    stamps = t * (1.0 + drift) + np.where(t > 12.0, step, 0.0)
    late = rng.exponential(0.001, t.size) + np.where((t > 5) & (t < 5.2), stall, 0.0)
    received = t + late
    return (np.rint(x * 1e9).astype(np.int64) + 10**18 for x in (stamps, received))


def test_delayed_messages_raise_no_doubt_of_the_clock():
    for seed in range(5):
        fit = fit_clock(*times(seed=seed, stall=0.1, drift=20e-6))
        assert doubts_of_clock("/a", fit) == []
        assert fit.drift == pytest.approx(20e-6, abs=15e-6)
        assert fit.offset == pytest.approx(0.0, abs=5e-4)


def test_a_step_is_reported_with_its_time():
    fit = fit_clock(*times(step=0.05))
    (doubt, *_) = doubts_of_clock("/a", fit)
    assert "jump by 50 ms" in doubt
    assert fit.step_at == pytest.approx(12.0, abs=0.8)


def test_recorder_times_are_free_of_delay_and_drift():
    stamps, received = times(drift=1e-3)
    fit = fit_clock(stamps, received)
    found = fit.recorder_times(stamps, received)
    true = stamps[0] + np.rint((stamps - stamps[0]) / 1.001).astype(np.int64)
    assert np.abs(found - true).max() < 1e6
    assert replace(fit, sure=(-1.0, 1.0)).is_drifting is False


def test_messages_of_one_stamp_are_refused(imported):
    def same_stamp(messages):
        for _, _, message in messages:
            message.header.stamp.sec = 1
            message.header.stamp.nanosec = 0
        return messages

    words = "1499 of 1500 messages of /joint_states have the stamp of another one"
    with pytest.raises(SettingsError, match=words):
        imported(StrokeLog(changes=(same_stamp,)))


def test_messages_of_one_receipt_have_no_time_of_receipt(imported):
    def same_receipt(messages):
        return [(topic, messages[0][1], message) for topic, _, message in messages]

    with pytest.raises(
        SettingsError, match="was received at 1 times for 1500 messages"
    ):
        imported(StrokeLog(changes=(same_receipt,)), clock="receipt")
