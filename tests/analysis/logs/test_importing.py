"""A log of a robot whose truth is known: what is found, and what is refused."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.prepare import moving_average
from analysis.logs.importing import ImportRequest, import_log
from tests.analysis.logs.gantry import Rubbing, write_bag, write_bag2, write_urdf


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return a function that writes a log once for all tests of it."""
    folder = tmp_path_factory.mktemp("logs")
    logs = {}

    def write(rubbing, writer):
        key = f"{rubbing} {vars(rubbing).keys()}"
        if key not in logs:
            logs[key] = writer(folder / f"{len(logs)}", rubbing)
        return logs[key]

    return write


@pytest.fixture
def imported(tmp_path, written):
    """Return a function that writes a log and imports it."""
    urdf = write_urdf(tmp_path)

    def make(rubbing, write=write_bag2, **options):
        asked = {"foot": "foot", "sensor": "gauge", "acts": "ground-on-foot"} | options
        return import_log(ImportRequest(written(rubbing, write), urdf, **asked))

    return make


def figure(found, name):
    (estimate,) = (each for each in found.estimates if each.name == name)
    return np.array(estimate.value), np.array(estimate.spread)


def errors(trial, rubbing):
    """Return rms of v_t [m/s], F_t and F_n [N], away from starts, stops, touch-down."""
    v_t, F_t, F_n = rubbing.truth(trial.t + trial.start)
    sliding = (v_t > 0.01) & np.isfinite(trial.traction).all(axis=1)
    calm = moving_average(sliding.astype(float), 31) > 0.999
    assert calm.sum() > 500
    found = np.column_stack([moving_average(x, 11) for x in trial.traction.T])
    rest = (found - np.column_stack([v_t, F_t, F_n]))[calm]
    return np.sqrt(np.mean(rest**2, axis=0))


@pytest.mark.slow
def test_velocity_and_forces_are_those_of_the_truth(imported):
    rubbing = Rubbing(strokes=2, turn=1.0, tilt=0.3, slope=0.1, heading=0.7, lost=0.003)
    found = imported(rubbing)
    assert [trial.name for trial in found.trials] == ["T01", "T02"]
    for trial in found.trials:
        v_t, F_t, F_n = errors(trial, rubbing)
        assert v_t < 1e-3
        assert max(F_t, F_n) < 0.05
    tare, spread = figure(found, "tare")
    assert tare[:3] == pytest.approx(rubbing.bias[:3], abs=0.02)
    assert (spread[:3] < 0.02).all()
    assert figure(found, "mass")[0] == pytest.approx([0.3], abs=0.005)
    x_T, _, z_T = rubbing.axes_of_ground()
    assert figure(found, "normal")[0] == pytest.approx(z_T, abs=2e-3)
    assert figure(found, "direction")[0] == pytest.approx(x_T, abs=2e-3)
    assert found.trials[0].series.incline_deg == pytest.approx(
        -np.degrees(0.1), abs=0.1
    )
    assert found.warnings == []


@pytest.mark.slow
@pytest.mark.parametrize("lag", [-0.02, 0.0, 0.018, 0.06])
def test_the_lag_is_found_within_the_interval_that_is_stated(imported, lag):
    found = imported(Rubbing(lag=lag), mass=0.3)
    (value,), (low, high) = figure(found, "lag")
    assert value == pytest.approx(lag * 1e3, abs=5)
    assert low <= lag * 1e3 <= high


def smooth():
    """Return a recording without starts and stops that show a lag."""
    rubbing = Rubbing()
    rubbing.speed = lambda t: 0.03 * np.sin(np.pi * np.clip(t - 3.5, 0, 7) / 7) ** 2
    return rubbing


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rubbing", "words"),
    [(Rubbing(), "starts and stops show"), (smooth(), "over 30 ms is rare")],
)
def test_a_lag_that_is_given_is_held_against_the_motion(imported, rubbing, words):
    far = imported(rubbing, mass=0.3, lag=0.09).warnings
    assert any("a lag of 90 ms was given" in text and words in text for text in far)
    near = imported(rubbing, mass=0.3, lag=rubbing.lag).warnings
    assert not any("lag of" in text for text in near)


@pytest.mark.slow
def test_a_lag_of_a_smooth_push_is_not_claimed(imported):
    found = imported(smooth(), mass=0.3)
    assert figure(found, "lag")[0] == 0.0
    assert any("is not known and taken as 0" in text for text in found.warnings)


@pytest.mark.slow
def test_the_other_sign_is_refused_with_the_remedy(imported):
    with pytest.raises(SettingsError, match="Give the other --acts"):
        imported(Rubbing(), acts="foot-on-ground", mass=0.3)
    with pytest.raises(SettingsError, match="are not those of the sensor's frame"):
        imported(Rubbing(), sensor="upright", mass=0.0)


@pytest.mark.slow
def test_a_sensor_that_reads_the_reaction_is_read_with_the_other_word(imported):
    rubbing = Rubbing(sign=-1.0)
    found = imported(rubbing, acts="foot-on-ground", mass=0.3)
    assert (errors(found.trials[0], rubbing)[1:] < 0.05).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axes", "said"),
    [((1, 0, 2), "moments are -1.0 times"), ((2, 1, 0), "F_t exceeds F_n")],
)
def test_exchanged_axes_are_named(imported, axes, said):
    found = imported(Rubbing(axes=axes))
    assert any(said in text for text in found.warnings)


def test_a_forgotten_weight_is_named_with_what_it_costs(imported):
    found = imported(Rubbing(tilt=0.3))
    assert any("every 0.1 kg left out is" in text for text in found.warnings)


def test_a_forgotten_tare_is_refused(imported):
    with pytest.raises(SettingsError, match=r"reads 14\.2 N"):
        imported(Rubbing(), tare="none", mass=0.3)
    with pytest.raises(SettingsError, match="stands on the ground"):
        imported(Rubbing(), tare=(5.0, 6.0))


@pytest.mark.slow
def test_a_tare_may_be_six_numbers_or_another_log(imported, tmp_path):
    rubbing = Rubbing()
    found = imported(rubbing, tare=np.array(rubbing.bias), mass=0.3)
    assert (errors(found.trials[0], rubbing)[1:] < 0.05).all()
    free = Rubbing(mass=0.3)
    free.truth = lambda t: (0.0 * t, 0.0 * t, 0.0 * t)
    free.seed = 5
    other = write_bag(tmp_path / "free.bag", free)
    found = imported(rubbing, tare=other)
    assert (errors(found.trials[0], rubbing)[1:] < 0.05).all()
    with pytest.raises(SettingsError, match="how the sensor stood"):
        imported(rubbing, tare=other, mass=0.3)


@pytest.mark.slow
def test_a_tare_that_drifts_is_stated_with_its_spread(imported):
    found = imported(Rubbing(bias_drift=0.02), mass=0.3)
    assert figure(found, "tare")[1][0] > 0.05


@pytest.mark.slow
def test_without_stamps_the_receipt_counts_and_is_named(imported):
    found = imported(Rubbing(stamps=False), mass=0.3)
    assert found.wrench.clock.by == "receipt"
    assert any("times of receipt" in text for text in found.warnings)


@pytest.mark.slow
def test_two_clocks_are_refused_with_the_hours_between(imported):
    with pytest.raises(
        SettingsError, match="18000 s apart by their stamps: two clocks"
    ):
        imported(Rubbing(clock_offset=-18_000.0))


@pytest.mark.slow
def test_slow_joints_are_refused_unless_means_are_wanted(imported):
    rubbing = Rubbing(joint_rate=40.0)
    with pytest.raises(SettingsError, match="too slow for slips"):
        imported(rubbing)
    assert any(
        "slips are not seen" in w for w in imported(rubbing, is_slow=True).warnings
    )


@pytest.mark.slow
def test_velocities_that_are_filtered_are_named_and_not_used(imported):
    found = imported(Rubbing(with_velocity=True, velocity_late=0.012), mass=0.3)
    assert any("12 ms late" in text for text in found.warnings)
    found = imported(Rubbing(), mass=0.3)
    assert errors(found.trials[0], Rubbing())[0] < 1e-3


@pytest.mark.slow
def test_another_frame_in_the_header_is_named(imported):
    found = imported(Rubbing(frame_id="tool0"), mass=0.3)
    assert any("frame 'tool0'; 'gauge' is used" in text for text in found.warnings)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"wrench": "/nothing"}, "no topic '/nothing'"),
        ({"wrench": "/joint_states"}, "which is its wrench"),
        ({"wrench": "/ft/wrench:header"}, "'header' in it is no wrench"),
        ({"joints": "/ft/wrench"}, "not a sensor_msgs/JointState"),
        ({"lag": 0.2}, "A lag of 200 ms"),
        ({"tare": (50.0, 60.0)}, "holds no readings"),
        ({"trials": [(0.0, 1.5)]}, "never moves forward between 0.0 and 1.5 s"),
        ({"along": np.array([0, 0, 1.0])}, "stands on the ground"),
        ({"foot": "fut"}, "nearest links are foot"),
    ],
)
def test_what_cannot_be_is_refused_with_a_way_out(imported, options, why):
    with pytest.raises(SettingsError, match=why) as error:
        imported(Rubbing(), mass=0.3, **options)
    assert error.value.hint


@pytest.mark.slow
def test_heading_and_incline_give_the_same_as_the_way(imported):
    rubbing = Rubbing(slope=0.1, heading=0.7)
    found = imported(
        rubbing,
        mass=0.3,
        heading_deg=float(np.degrees(0.7)),
        incline_deg=float(np.degrees(0.1)),
    )
    assert (errors(found.trials[0], rubbing) < [1e-3, 0.05, 0.05]).all()
