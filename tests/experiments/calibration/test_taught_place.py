"""`traction teach` measures a place from touches of both ends of a container."""

import numpy as np
import pytest

import experiments.operator.auto_operator as operator
from acquisition.errors import PreflightError, SettingsError
from experiments.calibration.taught_place import EndTouch, fit_ends
from experiments.settings.load import load_settings, load_untaught
from experiments.settings.places import TaughtPlace
from tests.experiments.program import traction, write_config

QUICK = ("--fake", "--fast", "--operator-script", "auto")
CELL = """version = "1.0"
[[cells]]
name = "T1"
foot = "tread"
ground = "plate"
place = "bay"
"""


@pytest.fixture(scope="module")
def taught(tmp_path_factory):
    folder = tmp_path_factory.mktemp("taught")
    config = write_config(folder, travel=0.2)
    place = (
        "[places.bay]\nfar_end = [0.66, 0.0, 0.12]\ntravel = 0.2\nincline_deg = -4\n"
    )
    config.write_text(f"{config.read_text()}\n{place}")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(operator, "TOUCH_SECONDS", 6.0)
        done = traction("teach", "bay", *QUICK, "--data", folder, "--config", config)
    assert done.code == 0, done.err
    return folder, done


@pytest.mark.slow
def test_touches_of_both_ends_give_the_place(taught):
    folder, done = taught
    found = TaughtPlace.parse((folder / "place_bay.fake.toml").read_text())
    assert (found.place, found.foot, found.simulated) == ("bay", "tread", True)
    assert found.travel == pytest.approx(0.2, abs=0.01)
    assert found.incline_deg == pytest.approx(-4.0, abs=1.5)
    assert found.heading_deg == pytest.approx(0.0, abs=1.0)
    assert found.far_end[:2] == pytest.approx((0.66, 0.0), abs=0.008)
    assert "[places.bay] taught" in done.out


@pytest.mark.slow
def test_a_cell_takes_its_numbers_from_a_taught_place(taught, tmp_path):
    folder, _ = taught
    shipped = load_settings(None).rig_text
    name = "place_bay.fake.toml"
    (tmp_path / name).write_text((folder / name).read_text())
    config, line = tmp_path / "rig.toml", f'\n[places.bay]\ntaught = "{name}"\n'
    config.write_text(shipped + line)
    (tmp_path / "matrix.toml").write_text(CELL)
    row = load_settings(config).row("T1")
    assert (row.taught, row.place) == (name, "bay")
    assert row.travel == pytest.approx(0.2, abs=0.01)
    assert row.start_q is not None
    config.write_text(f"{shipped}{line}travel = 0.3\n")
    with pytest.raises(SettingsError, match="taught and has numbers of its own"):
        load_settings(config)
    config.write_text(shipped + line.replace("places.bay", "places.pit"))
    with pytest.raises(SettingsError, match="is of place bay, not of pit"):
        load_settings(config)
    config.write_text(shipped + line)
    (tmp_path / name).write_text("place = 3")
    with pytest.raises(SettingsError, match="is no place"):
        load_settings(config)


def test_an_invalid_place_or_foot_is_refused_before_anything_starts(tmp_path):
    config = write_config(tmp_path)
    options = (*QUICK, "--config", config, "--data", tmp_path)
    for words, cause in (
        (("Bay",), "is no name of a place"),
        (("bay", "--foot", "claw"), "There is no foot 'claw'"),
    ):
        done = traction("teach", *words, *options)
        assert done.code == 2
        assert cause in done.err


def test_scattered_touches_of_one_end_are_refused():
    near = [EndTouch(np.array([0.2, 0.0, 0.1]), np.zeros(7))] * 3
    far = [
        EndTouch(np.array([0.6 + 0.02 * k, 0.0, 0.1]), np.zeros(7)) for k in range(3)
    ]
    with pytest.raises(PreflightError, match="touches of the far end lie 20 mm"):
        fit_ends(near, far)
    ends = fit_ends(near, far[:1] * 3)
    assert ends.travel == pytest.approx(0.4)
    assert (ends.heading, ends.incline) == pytest.approx((0.0, 0.0))


def test_an_untaught_place_needs_no_settings_of_its_own(tmp_path):
    _, row = load_untaught(None, "bay_2", None)
    assert (row.name, row.foot) == ("place-bay-2", "tread")
    config = write_config(tmp_path).rename(tmp_path / "other.toml")
    for path, name in ((None, "rig.toml"), (config, "other.toml")):
        with pytest.raises(SettingsError) as refused:
            load_untaught(path, "bay2", "shoe")
        assert str(refused.value).startswith(f"There is no foot 'shoe' in {name}.")
        assert "Feet: tread, bare" in str(refused.value.hint)
