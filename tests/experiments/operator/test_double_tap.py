import numpy as np
import pytest

from acquisition.trial_file.reader import TrialReader
from experiments.operator.foot_gesture import RELEASE_FORCE, DoubleTap
from experiments.operator.prompts import Prompt
from tests.experiments.program import journal, run_watched, write_config

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

RATE = 500
REST = 3.0  # N, load of a resting foot


def pressed(*presses, lasts=3.0, rest=REST, force=12.0):
    """(t, F_n, v_t) with `presses` of (start, duration) [s]."""
    t = np.arange(0.0, lasts, 1 / RATE)
    F_n = np.full(len(t), rest)
    for begin, duration in presses:
        F_n[(t >= begin) & (t < begin + duration)] = force
    return t, F_n, np.zeros(len(t))


def is_tap(t, F_n, v_t, portion=10):
    """Return whether the detector, fed 20 ms at a time, finds a double tap."""
    detector = DoubleTap()
    starts = range(0, len(t), portion)
    chunks = [slice(max(0, i - 7), i + portion) for i in starts]  # overlap: 7 samples
    return any(detector.feed(t[s], F_n[s], v_t[s]) for s in chunks)


@pytest.mark.parametrize(
    ("presses", "expected"),
    [
        ([(0.5, 0.1), (0.9, 0.1)], True),
        ([(0.5, 0.1), (1.49, 0.1)], True),
        ([(0.5, 0.1), (1.52, 0.1)], False),  # more than a second apart
        ([(0.5, 0.1), (1.6, 0.1), (2.2, 0.1)], True),  # counts from the second press
        ([(0.5, 0.1)], False),
        ([(0.5, 0.5), (1.1, 0.1)], False),  # leaning on the foot is no tap
        ([(0.5, 0.1), (0.8, 0.5)], False),
        ([(0.5, 0.01), (0.9, 0.01)], False),  # a knock on the frame
        ([], False),
    ],
)
def test_two_short_presses_in_quick_succession_are_a_double_tap(presses, expected):
    assert is_tap(*pressed(*presses)) is expected


def test_a_press_needs_a_minimum_force():
    presses = [(0.5, 0.1), (0.9, 0.1)]
    assert not is_tap(*pressed(*presses, force=7.9))
    assert is_tap(*pressed(*presses, force=8.1))


def test_the_foot_must_be_released_between_two_presses():
    presses = [(0.5, 0.1), (0.9, 0.1)]
    assert not is_tap(*pressed(*presses, rest=RELEASE_FORCE + 0.1))
    assert is_tap(*pressed(*presses, rest=RELEASE_FORCE - 0.1))


def test_a_sliding_foot_is_no_double_tap():
    t, F_n, v_t = pressed((0.5, 0.1), (0.9, 0.1))
    v_t[(t > 0.7) & (t < 0.72)] = 0.06
    assert not is_tap(t, F_n, v_t)
    v_t[v_t > 0] = 0.04
    assert is_tap(t, F_n, v_t)


def test_samples_of_nan_are_no_double_tap():
    t, F_n, v_t = pressed((0.5, 0.1), (0.9, 0.1))
    assert not is_tap(t, np.full_like(F_n, np.nan), v_t)
    assert not is_tap(t, F_n, np.full_like(v_t, np.nan))


def test_a_normal_push_is_no_double_tap(recorded):
    """A push with five times the load is one long press, so no double tap either.

    Twice the load is not tested: where the arm sticks, F_n would cross the thresholds
    repeatedly.
    """
    for name in ("T01", "T02"):
        path = recorded.folder / "trials" / f"{name}.mcap"
        cycles = TrialReader(path).cycles().data
        truth = TrialReader(path.with_suffix(".truth.mcap")).truth().data
        v_t, _, F_n = cycles["traction"].T
        host_ns = cycles["host_ns"].astype(float)
        # Scale the true load only, not the sensor's error.
        true_F_n = np.interp(host_ns, truth["host_ns"], truth["traction"][:, 2])
        for factor in (1.0, 5.0):
            measured = F_n + (factor - 1.0) * true_F_n
            assert not is_tap(host_ns * 1e-9, measured, v_t)


def test_a_stick_slip_push_is_no_double_tap():
    """The foot slips five times a second and sticks in between."""
    t = np.arange(0.0, 10.0, 1 / RATE)
    phase = t * 5.0 % 1.0
    v_t = np.where(phase > 0.8, 0.3, 0.0)
    F_n = 7.0 + 5.0 * np.cos(2 * np.pi * phase)
    assert not is_tap(t, F_n, v_t)


def tapping(asked, rig):
    """Tap the foot twice with a finger where a double tap replaces a key."""
    if asked.prompt not in {Prompt.READY, Prompt.REVIEW}:
        return " " if asked.prompt is Prompt.RECORDING and asked.since > 0.3 else None
    since = asked.since - 2.0
    is_down = 0.0 < since < 0.1 or 0.4 < since < 0.5
    rig.plant.finger = (0.0, 0.0, 14.0 if is_down else 0.0)
    return "q" if asked.since > 3.5 else ""


@pytest.fixture(scope="module")
def handsfree(tmp_path_factory):
    folder = tmp_path_factory.mktemp("taps")
    return write_config(folder, rig=("double_tap = false", "double_tap = true"))


def test_a_double_tap_starts_a_trial_and_keeps_it(handsfree, tmp_path):
    seen = run_watched(handsfree, tmp_path, 1, press=tapping)
    assert (seen.done.code, seen.done.err) == (0, "")
    assert [e["event"] for e in journal(seen.folder)].count("trial-kept") == 1


def test_a_double_tap_is_ignored_without_the_setting(config, tmp_path):
    seen = run_watched(config, tmp_path, 1, press=tapping)
    assert seen.done.code == 5
    assert "trial-started" not in [e["event"] for e in journal(seen.folder)]
