"""What a trial without a fault is doubted for is counted, by the name of the doubt."""

import pytest

from acquisition.trial_file.reader import TrialReader
from analysis.data.load import load_trial
from analysis.data.plausibility import DOUBTS
from ft_sensor.calibration.files import payload_to_toml
from studies.false_alarms import PAGE, Alarms, page
from tests.disturbances.measure import recorded_trial
from tests.disturbances.rewriting import rewrite
from tests.disturbances.rows import RECORDINGS, Recording


@pytest.fixture(scope="module")
def trials(tmp_path_factory):
    """Return a sound trial, and one whose sensor is turned."""
    half_turn = next(row for row in RECORDINGS if "by 180 degrees" in row.name)
    folder = tmp_path_factory.mktemp("turned")
    with recorded_trial() as source:
        sound = load_trial(source)
        cycles = TrialReader(source).cycles().data
        payload, frame = sound.payload, sound.frame
        recording = Recording(cycles, payload, frame, sound.sole_point)
        turned = half_turn.disturb(recording)
        text = payload_to_toml(turned.payload, turned.sole).encode()
        files = {"ft_calibration.toml": text}
        path = rewrite(source, folder / "T01.mcap", turned.cycles, files)
        yield sound, load_trial(path)


def test_a_sound_trial_raises_no_doubt(trials):
    alarms = Alarms()
    alarms.judge("seed 1", [trials[0]])
    assert (alarms.trials, alarms.doubts.total()) == (1, 0)
    assert "below 300.0% with 95 %" in page(alarms, 1, 0.02, 1)


def test_every_doubt_is_counted_once_a_trial_and_told(trials):
    alarms = Alarms()
    alarms.judge("seed 1", [trials[1], trials[1]])
    assert alarms.trials == 2
    assert alarms.doubts["power"] == 2
    assert alarms.doubts["warning"] > 0
    assert any("seed 1, " in line and "drives the foot" in line for line in alarms.seen)
    text = page(alarms, 1, 0.02, 2)
    assert "| power | 2 |" in text
    assert "with 95 %" not in text


def test_the_page_has_a_row_for_every_doubt():
    text = PAGE.read_text()
    assert all(f"| {name} | " in text for name in DOUBTS)
