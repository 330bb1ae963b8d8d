"""Rigs that are not what they are taken for, activated with nobody at them."""

import pytest

from studies.wrong_rigs import OTHERS, RIGS, are_bounded, run

pytestmark = pytest.mark.slow

FRICTION = 0.3


@pytest.fixture(scope="module")
def found():
    return {rig.name: run(rig, FRICTION) for rig in RIGS}


def test_most_wrong_rigs_are_idled_soon_and_stay_slow(found):
    assert are_bounded(list(found.values())), [each.row() for each in found.values()]


def test_an_arm_that_is_activated_too_early_does_not_move(found):
    early = found["activated while the program is idle"]
    assert early.reason == "not-asked-active"
    assert early.idle_ms <= 10.0
    assert early.travel < 0.001


def test_every_rig_but_the_torn_cable_is_told(found):
    assert all(each.reason for each in found.values()), found


def test_a_sound_arm_stays_where_it_is():
    (sound,) = [rig for rig in OTHERS if rig.name == "sound"]
    seen = run(sound, FRICTION)
    assert (seen.reason, round(1e3 * seen.end)) == ("", 0)
