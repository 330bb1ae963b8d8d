"""Trials written as ROS 2 topics and imported again agree with their recordings."""

import re
from dataclasses import replace

import numpy as np
import pytest
from mcap.writer import Writer

from acquisition.errors import SettingsError
from acquisition.schema import schema_text
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.views import VIEW_TOPICS, encode_views
from analysis.data.load import load_trial
from analysis.data.prepare import PrepareOptions, moving_average, prepare_trial
from analysis.logs.importing import import_log
from analysis.logs.opening import open_log
from analysis.logs.request import ImportRequest
from analysis.tables.loading import load_tables
from experiments.export.standard_topics import standard_topics
from tests.disturbances.measure import recorded_trial
from tests.disturbances.rows import RECORDINGS, Outcome, Recording
from tests.experiments.program import traction

FRAMES = """
  <link name="ft_sensor"/><joint name="gauges" type="fixed">
   <parent link="wam_tool"/><child link="ft_sensor"/>
   <origin xyz="0 0 {height}" rpy="0 0 {angle}"/></joint>
  <link name="sole"/><joint name="foot" type="fixed">
   <parent link="wam_tool"/><child link="sole"/>
   <origin xyz="{sole}" rpy="0 0 0"/></joint>
</robot>"""


def write_topics(path, cycles, times):
    """Write the standard topics of cycles, one message at each of `times` [UTC ns]."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="test")
        channels = {}
        for topic, name in VIEW_TOPICS.items():
            schema = writer.register_schema(name, "ros2msg", schema_text(name).encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for record, time in zip(cycles, times, strict=True):
            for topic, data in encode_views(record, time).items():
                writer.add_message(channels[topic], time, data, time)
        writer.finish()


def write_frames(folder, reader, trial, sole):
    """Write the arm's URDF with the frames of sensor and sole."""
    rotation = trial.payload.rotation
    frames = FRAMES.format(
        height=trial.sensor_height,
        angle=np.arctan2(rotation[1, 0], rotation[0, 0]),
        sole=" ".join(map(str, sole)),
    )
    urdf = folder / "wam.urdf"
    text = reader.attachments["robot.urdf"].decode()
    urdf.write_text(text.replace("</robot>", frames))
    return urdf


@pytest.fixture(scope="module")
def own(first_trial, tmp_path_factory):
    """A trial, and a function that imports its topics."""
    folder = tmp_path_factory.mktemp("topics")
    trial, reader = load_trial(first_trial), TrialReader(first_trial)
    urdf = write_frames(folder, reader, trial, trial.sole_point)

    def imported(**options):
        log = folder / "log.mcap"
        rows = reader.cycles()
        write_topics(log, rows.data, rows.log_time.tolist())
        x_T, _, z_T = trial.frame.axes()
        asked = {"along": x_T, "normal": z_T, "lag": 0.0, "tare": "none", "mass": 0.0}
        asked |= {"trials": [(0.0, float(trial.t[-1]))], **options}
        request = ImportRequest(
            log, urdf, "sole", "ft_sensor", "ground-on-foot", **asked
        )
        return import_log(request)

    return trial, imported


def test_an_imported_trial_agrees_with_its_recording(own):
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


# Standard topics carry no flags of the sensor and no target of joint 7.
UNSEEN = {"axis saturated", "force samples stale", "foot rotated by 0.1 rad (loose)"}
FLAGGED = [
    row
    for row in RECORDINGS
    if row.outcome is Outcome.FLAGGED and row.name not in UNSEEN
]


def imported_as(recording, reader, trial, folder):
    """Import a disturbed recording by its raw wrench, with its tare and weight."""
    cycles, payload, frame = recording.cycles, recording.payload, recording.frame
    cycles["wrench"] = cycles["wrench_raw"]
    offset = reader.cycles().log_time.astype(np.int64) - trial.cycles["host_ns"].astype(
        np.int64
    )
    times = cycles["host_ns"].astype(np.int64) + offset
    log = folder / "log.mcap"
    write_topics(log, cycles, times.tolist())
    urdf = write_frames(folder, reader, trial, recording.sole)
    x_T, _, z_T = frame.axes()
    acts = "ground-on-foot" if payload.sign > 0 else "foot-on-ground"
    span = (0.0, float(times[-1] - times[0]) * 1e-9)
    return import_log(
        ImportRequest(
            log,
            urdf,
            "sole",
            "ft_sensor",
            acts,
            tare=payload.bias,
            mass=payload.mass,
            along=x_T,
            normal=z_T,
            lag=0.0,
            trials=[span],
        )
    )


@pytest.fixture(scope="module")
def source():
    with recorded_trial() as path:
        yield path


@pytest.fixture
def disturbed(source, tmp_path):
    """A function that disturbs a recording; the warnings of its import."""
    trial, reader = load_trial(source), TrialReader(source)

    def warnings_of(disturb):
        cycles = reader.cycles().data.copy()
        recording = Recording(cycles, trial.payload, trial.frame, trial.sole_point)
        try:
            return imported_as(disturb(recording), reader, trial, tmp_path).warnings
        except SettingsError as error:
            return [error.message]

    return warnings_of


@pytest.mark.slow
@pytest.mark.parametrize("row", FLAGGED, ids=lambda row: row.name)
def test_a_disturbed_recording_is_refused_or_gives_a_warning(disturbed, row):
    usual = {re.sub(r"[-+]?[0-9.]+", "", text) for text in disturbed(lambda r: r)}
    shown = {re.sub(r"[-+]?[0-9.]+", "", text) for text in disturbed(row.disturb)}
    assert shown - usual, usual


def test_an_import_of_a_trial_file_is_refused(own, first_trial):
    _, imported = own
    request = imported().request
    with pytest.raises(SettingsError, match="this is a trial of Traction"):
        import_log(replace(request, log=first_trial))


def test_the_simulation_mark_of_a_log_is_kept_by_an_import(first_trial, tmp_path):
    log = tmp_path / "T01.mcap"
    log.write_bytes(standard_topics(TrialReader(first_trial)))
    with open_log(log) as opened:
        assert opened.is_simulated
    bare = tmp_path / "bare.mcap"
    rows = TrialReader(first_trial).cycles()
    write_topics(bare, rows.data, rows.log_time.tolist())
    with open_log(bare) as opened:
        assert not opened.is_simulated
    trial, reader = load_trial(first_trial), TrialReader(first_trial)
    urdf = write_frames(tmp_path, reader, trial, trial.sole_point)
    x_T, _, z_T = trial.frame.axes()
    done = traction(
        *("import", log, "--urdf", urdf, "--foot", "sole", "--sensor", "ft_sensor"),
        *("--acts", "ground-on-foot", "--tare", "none", "--lag", "0"),
        *("--tool-mass", "0", "--trials", f"0:{trial.t[-1]}"),
        *(f"--along={','.join(map(str, x_T))}", f"--normal={','.join(map(str, z_T))}"),
        *("--to", tmp_path / "out"),
    )
    assert done.code == 0, done.err
    assert "SIMULATED" in done.out
    (series,) = load_tables([tmp_path / "out"])["table"]
    assert series.is_simulated
