"""The program's own trials, written as ROS 2 topics at 500 Hz and imported back."""

import numpy as np
import pytest
from mcap.writer import Writer

from acquisition.errors import SettingsError
from acquisition.schema import schema_text
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.views import VIEW_TOPICS, encode_views
from analysis.data.load import load_trial
from analysis.data.plausibility import doubts_of
from analysis.data.prepare import PrepareOptions, moving_average, prepare_trial
from analysis.imported.importing import ImportRequest, import_log

FRAMES = """
  <link name="ft_sensor"/><joint name="gauges" type="fixed">
   <parent link="wam_tool"/><child link="ft_sensor"/>
   <origin xyz="0 0 {height}" rpy="0 0 {angle}"/></joint>
  <link name="sole"/><joint name="foot" type="fixed">
   <parent link="wam_tool"/><child link="sole"/>
   <origin xyz="{sole}" rpy="0 0 0"/></joint>
</robot>"""


def write_topics(path, reader, changed=lambda cycles: cycles):
    """Write the standard topics of a trial, a message a cycle."""
    rows = reader.cycles()
    cycles = changed(rows.data.copy())
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        channels = {}
        for topic, name in VIEW_TOPICS.items():
            schema = writer.register_schema(name, "ros2msg", schema_text(name).encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for record, time in zip(cycles, rows.log_time.tolist(), strict=True):
            for topic, data in encode_views(record, time).items():
                writer.add_message(channels[topic], time, data, time)
        writer.finish()


@pytest.fixture(scope="module")
def own(first_trial, tmp_path_factory):
    """Return a trial, its reader, and a function that imports its topics."""
    folder = tmp_path_factory.mktemp("topics")
    trial, reader = load_trial(first_trial), TrialReader(first_trial)
    rotation = trial.payload.rotation
    frames = FRAMES.format(
        height=trial.sensor_height,
        angle=np.arctan2(rotation[1, 0], rotation[0, 0]),
        sole=" ".join(map(str, trial.sole_point)),
    )
    urdf = folder / "wam.urdf"
    text = reader.attachments["robot.urdf"].decode()
    urdf.write_text(text.replace("</robot>", frames))

    def imported(changed=lambda cycles: cycles, **options):
        log = folder / "log.mcap"
        write_topics(log, reader, changed)
        x_T, _, z_T = trial.frame.axes()
        asked = {"along": x_T, "normal": z_T, "lag": 0.0, "tare": "none"}
        asked |= {"trials": [(0.0, float(trial.t[-1]))], **options}
        request = ImportRequest(
            log, urdf, "sole", "ft_sensor", "ground-on-foot", **asked
        )
        return import_log(request)

    return trial, imported


def test_an_own_trial_comes_back_as_it_was(own):
    trial, imported = own
    (back,) = imported().trials
    rows = min(len(back.t), len(trial.t))
    sound = np.isfinite(back.traction[:rows]).all(axis=1)
    sound &= np.isfinite(trial.traction[:rows]).all(axis=1)
    grid = np.column_stack(
        [np.interp(back.t[:rows], trial.t[: len(trial.t)], x) for x in trial.traction.T]
    )
    smooth = [
        np.column_stack([moving_average(np.nan_to_num(x), 11) for x in values.T])
        for values in (back.traction[:rows], grid)
    ]
    v_t, F_t, F_n = np.sqrt(np.mean((smooth[0] - smooth[1])[sound] ** 2, axis=0))
    assert v_t < 1e-3
    assert max(F_t, F_n) < 0.05
    options = PrepareOptions()
    kept = prepare_trial(back.series, options).kept
    right = prepare_trial(trial.series(), options).kept
    assert kept == pytest.approx(right, rel=0.01)


def turned_about_z(cycles):
    cycles["wrench"][:, [0, 1, 3, 4]] *= -1.0
    return cycles


def exchanged(cycles):
    cycles["wrench"] = cycles["wrench"][:, [1, 0, 2, 4, 3, 5]]
    return cycles


def reversed_sign(cycles):
    cycles["wrench"] *= -1.0
    return cycles


def late(cycles):
    cycles["wrench"] = np.roll(cycles["wrench"], 10, axis=0)
    return cycles


def in_millinewtons(cycles):
    cycles["wrench"] *= 1e3
    return cycles


@pytest.mark.parametrize(
    "changed", [turned_about_z, exchanged, reversed_sign, in_millinewtons]
)
def test_a_disturbed_recording_is_refused_or_named(own, changed):
    _, imported = own
    try:
        warnings = imported(changed).warnings
    except SettingsError as error:
        warnings = [error.message]
    undisturbed = imported().warnings
    assert set(warnings) - set(undisturbed)


def test_a_late_wrench_is_named_where_the_lag_was_given(own):
    _, imported = own
    (back,) = imported(late).trials
    named = {
        doubt.name for doubt in doubts_of(prepare_trial(back.series, PrepareOptions()))
    }
    assert "lag" in named


def test_an_own_recording_itself_is_refused_with_who_reads_it(own, first_trial):
    _, imported = own
    request = imported().request
    with pytest.raises(SettingsError, match="this is a trial of Traction"):
        import_log(
            ImportRequest(
                first_trial, request.urdf, "sole", "ft_sensor", "ground-on-foot"
            )
        )
