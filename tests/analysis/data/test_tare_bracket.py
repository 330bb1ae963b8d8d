"""Tares before and after a trial are read from its file and its sidecar."""

import json

import numpy as np
import pytest

from analysis.data.load import load_trial
from analysis.data.tare_bracket import TareBracket
from tests.analysis.data.test_load import BIAS, FORCE, PAYLOAD, make_cycles, write

START = 10**12  # host time of the first cycle [ns]
STORED = PAYLOAD.tared(BIAS, np.eye(3)).bias
NEXT = STORED + np.array([0.4, 0.0, -0.2, 0.0, 0.01, 0.0])
TARED = {"tared_ns": str(START - 2 * 10**9)}
NEXT_TARE = {"t_ns": START + 8 * 10**9, "bias": NEXT.tolist()}


@pytest.fixture
def load(tmp_path):
    """Load a trial that states the time of its tare, with the text of a sidecar."""

    def loaded(sidecar=None, fields=TARED):
        path = tmp_path / "T01.mcap"
        write(path, make_cycles(), fields=fields)
        if sidecar is not None:
            path.with_suffix(".json").write_text(sidecar)
        return load_trial(path)

    return loaded


def test_file_and_sidecar_give_both_tares(load):
    bracket = load(json.dumps({"next_tare": NEXT_TARE})).bracket
    assert bracket.times == (-2.0, 8.0)
    assert bracket.biases == pytest.approx(np.stack([STORED, NEXT]))


@pytest.mark.parametrize(
    "sidecar",
    [
        None,
        "",
        "[]",
        "{}",
        '{"next_tare": null}',
        '{"next_tare": {"t_ns": 1, "bias": [0, 0, 0, 0, 0, 0]}}',
        '{"next_tare": {"t_ns": 1008000000000, "bias": [0, 0, 0]}}',
        '{"next_tare": {"t_ns": 1008000000000, "bias": [0, 0, 0, 0, 0, NaN]}}',
        '{"next_tare": {"t_ns": "x", "bias": [0, 0, 0, 0, 0, 0]}}',
    ],
)
def test_a_sidecar_without_a_valid_tare_gives_no_bracket(load, sidecar):
    trial = load(sidecar)
    assert trial.bracket is None
    assert trial.with_interpolated_tare() is trial


def test_an_older_recording_without_the_time_of_its_tare_is_read(load):
    assert load(json.dumps({"next_tare": NEXT_TARE}), fields={}).bracket is None


def test_the_zero_is_interpolated_linearly_and_held_at_its_ends():
    bracket = TareBracket((-2.0, 8.0), np.stack([STORED, NEXT]))
    drift = bracket.drift(np.array([-5.0, -2.0, 3.0, 8.0, 9.0]))
    shares = np.array([0.0, 0.0, 0.5, 1.0, 1.0])
    assert drift == pytest.approx(shares[:, None] * (NEXT - STORED))


def test_an_interpolated_trial_uses_the_zero_at_each_instant(load):
    trial = load(json.dumps({"next_tare": NEXT_TARE}))
    other = trial.with_interpolated_tare()
    passed = (2.0 + trial.t) / 10.0
    drift = passed[:, None] * (NEXT - STORED)[:3]
    expected = FORCE - trial.payload.to_base(trial.payload.sign * drift, trial.rotation)
    assert other.force == pytest.approx(expected, abs=1e-9)
    axes = trial.frame.axes()
    assert other.traction[:, 1] == pytest.approx(-(expected @ axes[0]), abs=1e-9)
    assert other.traction[:, 2] == pytest.approx(expected @ axes[2], abs=1e-9)
    assert other.lateral == pytest.approx(expected @ axes[1], abs=1e-9)
    assert (other.traction[:, 0] == trial.traction[:, 0]).all()
