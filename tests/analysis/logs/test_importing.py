"""Statements about a log of known truth are applied, checked or refused."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.prepare import moving_average
from analysis.data.series import TractionSeries
from analysis.logs.checks import series_warnings
from analysis.logs.importing import import_log
from tests.analysis.logs.gantry import StrokeLog, import_request, write_bag2, write_urdf

TURNED = StrokeLog(turn=1.0)

FAST = {"joint_rate": 250.0, "wrench_rate": 400.0}  # Hz


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return a function that writes a log once for all tests of it."""
    folder = tmp_path_factory.mktemp("logs")
    logs = {}

    def write(stroke_log, writer):
        key = f"{stroke_log} {vars(stroke_log).keys()}"
        if key not in logs:
            logs[key] = writer(folder / f"{len(logs)}", stroke_log)
        return logs[key]

    return write


@pytest.fixture(scope="module")
def imported(tmp_path_factory, written):
    """Return a function that writes a log and imports it, its truth stated."""
    urdf = write_urdf(tmp_path_factory.mktemp("urdf"))

    def make(stroke_log, write=write_bag2, **options):
        log = written(stroke_log, write)
        return import_log(import_request(stroke_log, log, urdf, **options))

    return make


@pytest.fixture(scope="module")
def right(imported):
    """The import of a turned arm with true statements."""
    return imported(TURNED)


def check(found, name):
    (match,) = (row for row in found.checks if row.name == name)
    return match


def errors(trial, stroke_log):
    """Return rms of v_t [m/s], F_t and F_n [N], away from starts, stops, touch-down."""
    v_t, F_t, F_n = stroke_log.truth(trial.t + trial.start)
    sliding = (v_t > 0.01) & np.isfinite(trial.traction).all(axis=1)
    calm = moving_average(sliding.astype(float), 31) > 0.999
    assert calm.sum() > 500
    found = np.column_stack([moving_average(x, 11) for x in trial.traction.T])
    rest = (found - np.column_stack([v_t, F_t, F_n]))[calm]
    return np.sqrt(np.mean(rest**2, axis=0))


def is_right(trial, stroke_log):
    return bool((errors(trial, stroke_log) < [1e-3, 0.05, 0.05]).all())


@pytest.mark.slow
def test_velocity_and_forces_agree_with_the_truth(imported):
    stroke_log = StrokeLog(
        strokes=2, turn=1.0, tilt=0.3, slope=0.1, heading=0.7, lost=0.003, **FAST
    )
    found = imported(stroke_log)
    assert [trial.name for trial in found.trials] == ["T01", "T02"]
    assert all(is_right(trial, stroke_log) for trial in found.trials)
    assert found.trials[0].series.incline_deg == pytest.approx(
        -np.degrees(0.1), abs=0.1
    )
    assert found.warnings == []


def test_checks_confirm_correct_statements(imported):
    stroke_log = StrokeLog(turn=1.0, slope=0.1, heading=0.7)
    found = imported(stroke_log)
    assert check(found, "tare").shown[0] < 0.02  # N that the free foot reads
    assert check(found, "mass").shown == pytest.approx([0.3], abs=0.005)
    assert check(found, "lag").shown == pytest.approx([10.0], abs=5.0)
    low, high = check(found, "lag").spread
    assert low <= 10.0 <= high
    x_T, _, z_T = stroke_log.axes_of_ground()
    assert check(found, "normal").shown == pytest.approx(z_T, abs=2e-3)
    assert check(found, "direction").shown == pytest.approx(x_T, abs=2e-3)
    assert check(found, "clocks apart").shown == pytest.approx([9.4], abs=0.5)
    assert not any(row.warning for row in found.checks)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"mass": 0.5}, "--tool-mass 0.5 kg, the free foot shows 0.30 kg"),
        ({"lag": 0.09}, "--lag 90 ms; starts and stops show"),
        ({"tare": (1.5, 5.0)}, "halves of the window of --tare differ by"),
        ({"tare": np.array([3.0, -7.0, 9.0, 0, 0, 0])}, "the free foot reads 2.69"),
        ({"along": np.array([1.0, 0.2, 0.0])}, "degrees off --along"),
        ({"normal": np.array([0.2, 0.0, 1.0])}, "--normal is 11.3 degrees off"),
        ({"normal": np.array([0.035, 0.0, 1.0])}, "--normal is 2.0 degrees off"),
        ({"lag": 0.4}, "--lag 400 ms: the clocks are"),
    ],
)
def test_a_check_that_disagrees_is_reported_and_not_applied(
    imported, right, options, words
):
    found = imported(TURNED, **options)
    assert any(words in text for text in found.warnings), found.warnings
    traction = found.trials[0].traction
    assert not np.array_equal(right.trials[0].traction, traction, equal_nan=True)


def test_each_disagreement_of_a_path_is_reported_once(right, imported):
    for options in (
        {"along": np.array([1.0, 0.2, 0])},
        {"normal": np.array([0.2, 0, 1.0])},
    ):
        found = imported(TURNED, **options)
        of_path = [text for text in found.warnings if "foot's path" in text]
        assert len(of_path) == 1, of_path
    assert not any("foot's path" in text for text in right.warnings)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tare": (5.0, 6.0)}, "at its lowest position of the log"),
        ({"tare": "none"}, r"the free foot reads 14\.2"),
    ],
)
def test_implausible_ground_forces_are_refused_with_the_failed_check(
    imported, options, words
):
    with pytest.raises(SettingsError, match=words):
        imported(StrokeLog(), **options)


def smooth():
    """Return a recording without starts and stops that show a lag."""
    stroke_log = StrokeLog()
    stroke_log.speed = lambda t: 0.03 * np.sin(np.pi * np.clip(t - 3.5, 0, 7) / 7) ** 2
    return stroke_log


@pytest.mark.slow
def test_a_lag_of_a_smooth_push_is_not_claimed(imported):
    shown = check(imported(smooth()), "lag")
    assert shown.shown == ()
    assert "starts and stops of the pressed foot are too few" in shown.how


@pytest.mark.slow
def test_unexplained_onsets_are_counted(imported):
    stroke_log = StrokeLog(strokes=3)
    stroke_log.truth = lambda t: (
        stroke_log.speed(t),
        np.where(stroke_log.lifted(t) <= 0, 3.0 + np.sin(7.3 * t), 0.0),
        np.where(stroke_log.lifted(t) <= 0, 10.0, 0.0),
    )
    how = check(imported(stroke_log), "lag").how
    assert "of F_t/F_n at" in how
    assert "% are needed" in how


def test_forces_of_the_opposite_sign_are_refused_with_the_remedy(imported):
    with pytest.raises(SettingsError, match="have the opposite sign") as error:
        imported(StrokeLog(), acts="foot-on-ground")
    assert "Give the other --acts" in error.value.hint
    with pytest.raises(SettingsError, match="cannot come from the ground"):
        imported(StrokeLog(), sensor="upright")


@pytest.mark.slow
def test_a_reaction_force_sensor_is_read_with_the_matching_option(imported):
    stroke_log = StrokeLog(sign=-1.0, **FAST)
    assert is_right(imported(stroke_log, acts="foot-on-ground").trials[0], stroke_log)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axes", "words"),
    [((1, 0, 2), "moments are -1.0 times"), ((2, 1, 0), "F_t exceeds F_n")],
)
def test_exchanged_axes_are_reported(imported, axes, words):
    found = imported(StrokeLog(axes=axes))
    assert any(words in text for text in found.warnings)


def test_a_missing_weight_is_reported_with_its_effect(imported):
    found = imported(StrokeLog(tilt=0.3), mass=0.0)
    assert any("every 0.1 kg of mass" in text for text in found.warnings)


@pytest.mark.slow
def test_a_tare_may_be_six_numbers(imported):
    stroke_log = StrokeLog(**FAST)
    found = imported(stroke_log, tare=np.array(stroke_log.bias))
    assert is_right(found.trials[0], stroke_log)


def test_slow_joint_states_are_refused_unless_means_are_requested(imported):
    stroke_log = StrokeLog(joint_rate=40.0)
    with pytest.raises(SettingsError, match=r"has 40\.0 Hz, the least is 50 Hz"):
        imported(stroke_log)
    assert any(
        "slips are not seen" in w for w in imported(stroke_log, is_slow=True).warnings
    )


def test_another_frame_in_the_header_is_reported(imported):
    found = imported(StrokeLog(frame_id="tool0"))
    assert any("frame 'tool0'; 'gauge' is used" in text for text in found.warnings)


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"wrench": "/nothing"}, "--wrench /nothing is not in the log"),
        ({"wrench": "/joint_states"}, "is a sensor_msgs/JointState"),
        ({"joints": "/ft/wrench"}, "is a geometry_msgs/WrenchStamped"),
        ({"lag": 20.0}, "--lag 20000 ms is beyond 10000 ms"),
        ({"tare": (50.0, 60.0)}, "--tare 50:60 is not within the log"),
        ({"tare": (-1.0, 0.6)}, "--tare -1:0.6 is not within the log"),
        ({"trials": [(0.0, 1.5)]}, "In 0 rows of the trials the force is over 2 N"),
        ({"trials": [(50.0, 51.0)]}, "--trials 50:51 is not within the log"),
        ({"trials": [(3.0, 12.1)]}, "--trials 3:12.1 is not within the log"),
        ({"trials": [(3.0, 3.001)]}, "--trials 3:3.001 holds 1 rows"),
        ({"tare": (0.1, 0.105)}, "--tare 0.1:0.105 holds 1 readings"),
        ({"along": np.array([0, 0, 1.0])}, "are the same direction"),
        ({"along": np.array([0.5, 0.8, 0])}, "The force across the path is"),
        ({"foot": "fut"}, "nearest links are foot"),
    ],
)
def test_impossible_options_are_refused_with_a_remedy(imported, options, why):
    with pytest.raises(SettingsError, match=why) as error:
        imported(StrokeLog(), **options)
    assert error.value.hint or "nearest" in str(error.value)


@pytest.mark.parametrize(
    "options", [{"trials": [(50.0, 51.0)]}, {"tare": (50.0, 60.0)}], ids=str
)
def test_a_span_beyond_a_cut_log_is_refused_with_the_cut(written, tmp_path, options):
    several_chunks = StrokeLog(joint_rate=500.0, wrench_rate=800.0)
    whole = next(written(several_chunks, write_bag2).glob("*.mcap"))
    data = whole.read_bytes()
    cut, urdf = tmp_path / "cut.mcap", write_urdf(tmp_path)
    cut.write_bytes(data[: int(0.8 * len(data))])
    with pytest.raises(SettingsError, match="is not within") as error:
        import_log(import_request(StrokeLog(), cut, urdf, **options))
    assert "The log goes from 0 to 6." in error.value.hint
    assert "nothing is read after byte" in error.value.hint


def test_implausible_speeds_name_what_an_import_can_correct():
    """A unit of v_t is no option of an import, and its package states metres."""
    t = np.arange(0.0, 8.0, 0.002)
    series = TractionSeries(
        "S0", "T01", t, 60.0 + 0.0 * t, 10.0 + 0.0 * t, 6.0 + 0.0 * t
    )
    (warning,) = series_warnings(series)
    assert "T01: v_t of 60 m/s" in warning
    assert "--unit" not in warning
    assert "the URDF is in m" in warning


@pytest.mark.parametrize(
    ("foot", "tilt", "shown", "is_reported"),
    [
        ("foot", 0.05, 0.0, False),
        ("gauge", 0.05, -20.0, True),
        ("gauge", 0.0, -20.0, False),  # no turn, no error of v_t
    ],
)
def test_a_foot_frame_above_the_sole_is_shown_by_the_moments(
    imported, foot, tilt, shown, is_reported
):
    """Also of a foot that tilts by 3 degrees, too little for its path to show."""
    found = imported(StrokeLog(tilt=tilt), foot=foot)
    sole = check(found, "sole")
    assert sole.shown == pytest.approx([shown], abs=3.0)
    assert ("20 mm below the origin of --foot" in sole.warning) is is_reported


def test_a_lag_is_not_compared_with_clocks_that_are_unknown(imported):
    """Without stamps there is no offset to state."""
    found = imported(StrokeLog(stamps=False), clock="receipt", lag=0.4)
    warning = check(found, "lag").warning
    assert "--lag 400 ms: the clocks show no offset" in warning


@pytest.mark.parametrize(("until", "rows"), [(8.0, 375), (20.0, 0)])
def test_a_wrench_that_ends_in_a_trial_is_reported(imported, until, rows):
    def cut(messages):
        end = messages[0][1] + until * 1e9
        return [row for row in messages if row[0] != "/ft/wrench" or row[1] < end]

    found = imported(StrokeLog(changes=(cut,)))
    missing = [text for text in found.warnings if "no reading of the wrench" in text]
    if not rows:
        assert missing == []
        return
    (text,) = missing
    assert "of 1000 rows" in text
    count = int(text.removeprefix("T01: ").partition(" ")[0])
    assert count == pytest.approx(rows, abs=5)
    assert "the first at 7.9" in text or "the first at 8.0" in text
