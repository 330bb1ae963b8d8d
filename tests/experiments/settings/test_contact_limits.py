"""Contact limits stay within the range of the fitted sensor."""

import pytest

from acquisition.errors import SettingsError
from experiments.preflight.host_checks import check_contact_limits
from experiments.rig.build import build_limits
from experiments.settings.load import load_settings
from tests.experiments.program import traction, write_config
from wam.model.constants import load_constants

BARRETT = ('kind = "bota"', 'kind = "barrett"')


def config(folder, *changes, kind=BARRETT):
    path = write_config(folder, rig=kind)
    text = path.read_text()
    if kind is BARRETT:
        text = text.replace("sinc = 64 ", "# sinc = 64 ")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return path


def guard(folder, *changes, **options):
    rig = load_settings(config(folder, *changes, **options)).rig
    return build_limits(rig, load_constants())


def test_default_limits_are_lowered_to_the_range_of_barretts_sensor(tmp_path):
    limits = guard(tmp_path)
    assert limits.contact_force == limits.contact_force_hold == pytest.approx(72.0)
    assert limits.contact_moment == limits.contact_moment_hold == pytest.approx(2.475)
    assert limits.contact_growth == 40.0


def test_limits_within_the_range_are_unchanged(tmp_path):
    change = ("contact_force = 100.0", "contact_force = 79.0")
    limits = guard(tmp_path, change)
    # The limit that ends a trial is not above the limit of hold.
    assert (limits.contact_force, limits.contact_force_hold) == (79.0, 79.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("contact_force = 100.0", "contact_force = 81.0"),
            "limits.contact_force = 81 N is beyond the 80 N that the barrett sensor",
        ),
        (
            ("contact_moment = 10.0", "contact_moment = 3.0"),
            "limits.contact_moment = 3 N m is beyond the 2.75 N m that the barrett",
        ),
    ],
)
def test_a_chosen_limit_beyond_the_range_is_refused(tmp_path, change, words):
    with pytest.raises(SettingsError) as refused:
        load_settings(config(tmp_path, change))
    assert words in refused.value.message


def test_ranges_stated_in_rig_toml_are_used(tmp_path):
    lines = "[300.0, 300.0, 90.0, 15.0, 15.0, 9.0]"
    ranged = ('kind = "bota"', f'kind = "bota"\nranges = {lines}')
    limits = guard(tmp_path, kind=ranged)
    assert limits.contact_force == pytest.approx(81.0)
    assert limits.contact_moment_hold == pytest.approx(8.1)


def test_lowered_limits_are_shown_on_the_preflight_page(tmp_path):
    path = write_config(tmp_path)
    done = traction("check", "--fake", "--fast", "--config", path, "--data", tmp_path)
    assert "contact_moment_hold 10.8: 0.9 of the sensor's range" in done.out


def test_a_limit_beyond_the_range_read_from_a_sensor_gives_a_warning(tmp_path):
    robotous = ('kind = "bota"', 'kind = "robotous"\nrate = 1000')
    path = config(tmp_path, ("sinc = 64 ", "# sinc = 64 "), kind=robotous)
    path.write_text(path.read_text().replace("460800", "921600"))
    rig = load_settings(path).rig
    assert rig.lowered_limits() == {}
    narrow = check_contact_limits(rig, {"ranges": "150 150 200 4 4 4"})
    assert narrow is not None
    assert "contact_moment = 10 > 4" in narrow.text
    assert check_contact_limits(rig, {"ranges": "400 400 400 20 20 20"}) is None
