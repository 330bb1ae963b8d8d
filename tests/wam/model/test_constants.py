import numpy as np
import pytest

from acquisition.errors import SettingsError
from wam.model.constants import load_constants

SHIPPED = load_constants()


def test_home_is_at_two_joint_stops():
    outside = (SHIPPED.home >= SHIPPED.q_upper) | (SHIPPED.home <= SHIPPED.q_lower)
    assert np.flatnonzero(outside).tolist() == [1, 3]


def test_the_source_text_is_kept_and_gives_the_same_arm():
    again = load_constants(SHIPPED.text)
    assert again.text == SHIPPED.text
    assert np.array_equal(again.j2mp, SHIPPED.j2mp)
    for ours, theirs in zip(again.links, SHIPPED.links, strict=True):
        assert ours.mass == theirs.mass
        assert np.array_equal(ours.inertia, theirs.inertia)


def test_inertias_are_physically_consistent():
    for link in SHIPPED.links:
        assert np.array_equal(link.inertia, link.inertia.T)
        moments = np.linalg.eigvalsh(link.inertia)
        assert moments[0] > 0.0
        assert moments[2] < moments[0] + moments[1]  # the triangle inequality


def test_the_transmission_matrix_is_invertible():
    assert np.linalg.matrix_rank(SHIPPED.j2mp) == 7


def changed(old, new):
    assert SHIPPED.text.count(old) >= 1
    return SHIPPED.text.replace(old, new, 1)


MALFORMED = {
    "empty": "",
    "no toml": "[kinematics\na = 1",
    "other toml": "[project]\nname = 'x'\n",
    "missing key": changed("alpha_over_pi", "beta_over_pi"),
    "extra key": changed("[kinematics]", "[kinematics]\nb = 1.0"),
    "six joints": changed("a = [0.0, ", "a = ["),
    "text": changed("mass = 10.7677", "mass = 'heavy'"),
    "no mass": changed("mass = 10.7677", "mass = 0.0"),
    "negative mass": changed("mass = 10.7677", "mass = -1.0"),
    "not a number": changed("mass = 10.7677", "mass = nan"),
    "infinite": changed("lower = [-2.6", "lower = [-inf"),
    "six links": SHIPPED.text + "\n[[links]]\nmass = 1.0\ncom = [0.0, 0.0, 0.0]\n"
    "inertia = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n",
    "half a count": changed("cts = [4096", "cts = [4096.5"),
    "no torque unit": changed("ipnm = [2700", "ipnm = [0"),
    "stops crossed": changed("lower = [-2.6", "lower = [2.7"),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_model_is_a_settings_error(name):
    with pytest.raises(SettingsError, match="arm model cannot be read") as caught:
        load_constants(MALFORMED[name])
    assert caught.value.hint


def test_a_missing_part_of_an_arm_model_is_reported_in_one_line():
    text = load_constants().text.replace("[gravity]", "[weight]")
    with pytest.raises(SettingsError) as caught:
        load_constants(text)
    message = str(caught.value)
    assert "gravity is missing" in message
    assert "\n" not in message
    assert "http" not in message


def test_contradicting_parts_of_an_arm_model_are_reported_in_one_line():
    with pytest.raises(SettingsError) as caught:
        load_constants(MALFORMED["stops crossed"])
    message = str(caught.value)
    assert "read: :" not in message
    assert "\n" not in message
