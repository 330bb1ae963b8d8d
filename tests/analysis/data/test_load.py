import struct
from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import TrialFileError
from acquisition.sample import Flag
from acquisition.schema import CYCLE
from acquisition.trial_file.recover import recover_file
from acquisition.trial_file.writer import TrialHeader, TrialWriter
from analysis.data.load import load_trial
from analysis.report.sections.rig_health.health import health_of, with_tares
from ft_sensor.calibration.files import payload_to_toml, terrain_to_toml
from ft_sensor.payload import TerrainFrame, payload_of
from wam.model.arm_model import ArmModel
from wam.model.constants import Body, load_constants
from wam.model.tool import Tool

CONSTANTS = load_constants()
TOOL = Tool(
    Body(0.136, np.array([0.0, 0.0, 0.006]), np.diag([7e-5, 7e-5, 1.4e-4])),
    Body(0.45, np.array([0.01, 0.0, 0.062]), np.diag([4e-4, 5.5e-4, 4.5e-4])),
    np.array([0.01, 0.0, 0.112]),
    sensor_angle=0.6,  # so that no frame is another one
)
MODEL = ArmModel(CONSTANTS, TOOL)
FRAME = TerrainFrame(0.1, 0.2, (0.7, 0.1, 0.12), 0.45)
PAYLOAD = payload_of(TOOL)
Q = np.array([0.1, 0.77, 0.0, 1.18, 0.0, 1.18, 0.2])
QD = np.array([0.02, -0.05, 0.01, 0.04, 0.0, 0.03, 0.0])
FORCE = np.array([-2.0, 0.5, 7.0])  # of the ground, base frame [N]
BIAS = np.array([0.4, -0.3, 0.2, 0.01, 0.0, -0.02])
ATTACHMENTS = {
    "arm_model.toml": CONSTANTS.text,
    "ft_calibration.toml": payload_to_toml(PAYLOAD.tared(BIAS, np.eye(3)), TOOL.sole),
    "terrain.toml": terrain_to_toml("S10", FRAME, {}),
}


def make_cycles(count=100):
    """Return records of an arm that moves steadily under a constant force."""
    records = np.frombuffer(bytearray(CYCLE.template * count), CYCLE.dtype)
    records["cycle"] = np.arange(count)
    records["host_ns"] = 10**12 + 2_000_000 * np.arange(count)
    t = np.arange(count) * 0.002
    records["position"] = Q + t[:, None] * QD
    tared = PAYLOAD.tared(BIAS, np.eye(3))
    for record in records:
        rotation = MODEL.sole_pose(record["position"])[1]
        weight = tared.weight(rotation)
        contact = np.zeros(6)
        contact[:3] = (rotation @ tared.rotation).T @ FORCE
        record["wrench_raw"] = tared.sign * (contact + weight) + tared.bias
    return records


def write(path, cycles=None, *, finish=True, drop=(), fields=(), **attachments):
    texts = ATTACHMENTS | attachments
    header = TrialHeader(
        trial={"session": "S001", "trial": "T01", "simulated": "true", **dict(fields)},
        utc_offset_ns=1_700_000_000_000_000_000,
        offset_uncertainty_ns=10,
        provenance={},
        attachments={k: v.encode() for k, v in texts.items() if k not in drop},
        robot_description="",
    )
    writer = TrialWriter(path, header)
    writer.write_cycles(make_cycles() if cycles is None else cycles)
    if finish:
        writer.finish("key")
        writer.partial.rename(path)
    else:
        writer.flush()
        writer.close_partial()
    return path


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    return load_trial(write(tmp_path_factory.mktemp("load") / "T01.mcap"))


@pytest.mark.parametrize(
    ("fields", "stones"), [({"stone_size": "none"}, "none"), ({}, "")]
)
def test_stones_are_read_from_the_recording(tmp_path, fields, stones):
    trial = load_trial(write(tmp_path / "T01.mcap", fields=fields))
    assert trial.series().stones == trial.series("sole").stones == stones


def test_the_sole_follows_the_joint_kinematics(trial):
    for k in (0, 50, 99):
        wanted = MODEL.sole_pose(trial.cycles["position"][k])[0]
        assert trial.sole[k] == pytest.approx(wanted, abs=1e-12)


def test_the_velocity_is_that_of_the_sole(trial):
    J = MODEL.sole_jacobian(trial.cycles["position"][50])
    # central differences over 4 ms of a smooth motion
    assert trial.velocity[50] == pytest.approx((J @ QD)[:3], abs=1e-6)


def test_the_force_is_that_of_the_ground_without_tare_and_weight(trial):
    assert trial.force == pytest.approx(np.tile(FORCE, (100, 1)), abs=1e-9)


def test_traction_is_velocity_and_force_in_the_frame_of_the_terrain(trial):
    x, y, z = FRAME.axes()
    v_t, F_t, F_n = trial.traction[50]
    assert v_t == pytest.approx(trial.velocity[50] @ x)
    assert F_t == pytest.approx(-(FORCE @ x))
    assert F_n == pytest.approx(FORCE @ z)
    assert trial.lateral[50] == pytest.approx(FORCE @ y)


def test_the_displacement_is_counted_from_the_far_end(trial):
    wanted = (trial.sole - np.array(FRAME.start)) @ FRAME.axes()[0]
    assert trial.displacement == pytest.approx(wanted)


def test_a_trial_has_its_name_terrain_and_kind(trial):
    assert (trial.name, trial.terrain, trial.is_simulated) == ("S001/T01", "S10", True)
    assert trial.frame == FRAME


def test_the_series_has_its_columns_in_order(trial):
    series = trial.series()
    assert (series.terrain, series.name) == ("S10", "S001/T01")
    assert series.v_t.tolist() == trial.traction[:, 0].tolist()
    assert series.F_t.tolist() == trial.traction[:, 1].tolist()
    assert series.F_n.tolist() == trial.traction[:, 2].tolist()
    assert series.t == pytest.approx(np.arange(100) * 0.002)


def test_the_calibration_in_the_file_is_used(trial, tmp_path):
    """A better calibration can be applied later."""
    untared = payload_to_toml(PAYLOAD, TOOL.sole)
    other = load_trial(write(tmp_path / "T.mcap", **{"ft_calibration.toml": untared}))
    assert np.abs(other.force - trial.force).max() > 0.3


def test_a_gap_has_no_velocity(tmp_path):
    cycles = np.delete(make_cycles(), slice(40, 50))
    loaded = load_trial(write(tmp_path / "T.mcap", cycles))
    rows = np.flatnonzero(np.isnan(loaded.velocity[:, 0]))
    assert rows.tolist() == [39, 40]
    assert loaded.series().dropped_rows == 2


def test_a_recovered_trial_is_loaded_as_incomplete(trial, tmp_path):
    write(tmp_path / "T.mcap", finish=False)
    loaded = load_trial(recover_file(tmp_path / "T.mcap.partial").path)
    states = [t.metadata["result"].get("complete") for t in (trial, loaded)]
    assert [state == "true" for state in states] == [True, False]
    assert loaded.force.tobytes() == trial.force.tobytes()


@pytest.mark.parametrize("name", sorted(ATTACHMENTS))
def test_a_file_without_an_attachment_is_refused(tmp_path, name):
    path = write(tmp_path / "T.mcap", drop=(name,))
    with pytest.raises(TrialFileError, match=f"lacks the attachment {name}"):
        load_trial(path)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("arm_model.toml", "x = ["),
        ("arm_model.toml", CONSTANTS.text.replace("mass = ", "mass = -", 1)),
        ("ft_calibration.toml", "[payload]\nmass = 1.0\n"),
        ("ft_calibration.toml", ATTACHMENTS["ft_calibration.toml"] + "\x00"),
        ("terrain.toml", 'name = "S10"\nincline = "steep"\n'),
        ("terrain.toml", ATTACHMENTS["terrain.toml"].replace("0.1\n", "nan\n", 1)),
        ("terrain.toml", ATTACHMENTS["terrain.toml"].replace('"S10"', '"\\u0007"')),
        ("terrain.toml", ATTACHMENTS["terrain.toml"].replace('"S10"', '""')),
    ],
)
def test_an_invalid_attachment_is_refused(tmp_path, name, text):
    assert text != ATTACHMENTS[name]
    path = write(tmp_path / "T.mcap", **{name: text})
    with pytest.raises(TrialFileError):
        load_trial(path)


def changed(field, row, value):
    cycles = make_cycles()
    cycles[field][row] = value
    return cycles


@pytest.mark.parametrize(
    ("cycles", "reason"),
    [
        (make_cycles(2), "holds only 2 cycles"),
        (changed("host_ns", 50, 10**12), "cycles out of order"),
        (changed("position", 50, np.nan), "joint positions that no arm can reach"),
        (changed("position", 50, np.inf), "joint positions that no arm can reach"),
        (changed("position", 50, 1e9), "joint positions that no arm can reach"),
        (changed("wrench_raw", slice(None), np.nan), "0 finite rows"),
    ],
)
def test_impossible_records_are_refused(tmp_path, cycles, reason):
    with pytest.raises(TrialFileError, match=reason):
        load_trial(write(tmp_path / "T.mcap", cycles))


def test_a_few_unknown_forces_are_dropped_and_counted(tmp_path):
    cycles = changed("wrench_raw", slice(0, 5), np.nan)
    assert load_trial(write(tmp_path / "T.mcap", cycles)).series().dropped_rows == 5


def test_an_unfinished_file_is_refused(tmp_path):
    write(tmp_path / "T.mcap", finish=False)
    with pytest.raises(TrialFileError, match="cut off"):
        load_trial(tmp_path / "T.mcap.partial")


@pytest.mark.parametrize(
    "content", [b"", b"\x89MCAP0\r\n", struct.pack("<100I", *[7] * 100)]
)
def test_a_file_that_is_not_a_trial_is_refused(tmp_path, content):
    path = tmp_path / "T.mcap"
    path.write_bytes(content)
    with pytest.raises(TrialFileError):
        load_trial(path)


def test_a_missing_trial_file_is_refused(tmp_path):
    with pytest.raises(TrialFileError, match=r"T\.mcap"):
        load_trial(tmp_path / "T.mcap")


def test_a_truth_file_is_not_a_trial(tmp_path):
    path = write(tmp_path / "T.mcap")
    path.write_bytes(path.read_bytes().replace(b"/cycle", b"/truth"))
    with pytest.raises(TrialFileError):
        load_trial(path)


def test_the_soles_own_axes_follow_its_tilt(trial):
    on_terrain, on_sole = trial.series(), trial.series("sole")
    normal = -trial.rotation[:, :, 2]
    assert on_sole.F_n == pytest.approx(normal @ FORCE)
    along = np.hypot(on_sole.F_n, on_sole.F_t)
    # both frames share the plane of x_T and the normal but for the tilt across it
    assert along == pytest.approx(np.hypot(on_terrain.F_n, on_terrain.F_t), rel=0.05)
    assert np.abs(on_sole.F_t - on_terrain.F_t).max() > 0.01


def test_a_level_sole_has_the_terrains_axes(trial):
    axes = trial.frame.axes()
    level = np.column_stack([axes[0], -axes[1], -axes[2]])
    flat = replace(trial, rotation=np.broadcast_to(level, trial.rotation.shape))
    expected, found = trial.series(), flat.series("sole")
    assert found.v_t == pytest.approx(expected.v_t, abs=1e-12)
    assert found.F_t == pytest.approx(expected.F_t, abs=1e-12)
    assert found.F_n == pytest.approx(expected.F_n, abs=1e-12)


def as_left(trial, name="T01", **columns):
    """Return the trial with other metadata and columns, as a rig may record it."""
    cycles = trial.cycles.copy()
    cycles["arm_ns"], cycles["ft_ns"] = cycles["host_ns"], cycles["host_ns"]
    for key, values in columns.items():
        cycles[key] = values
    fields = {
        "pucks:temperature_degc": "30 31 ? 33",
        "pucks:motor_temperature_degc": "",
    }
    metadata = trial.metadata | {
        "trial": {"session": "S001", "trial": name, "effective_mass_kg": "0.3"},
        "provenance": fields,
    }
    return replace(trial, cycles=cycles, metadata=metadata)


def summarised(trials):
    """Return the health of trials with the results of their tares."""
    return with_tares([health_of(trial) for trial in trials], trials)


def test_health_reports_age_temperature_and_saturation(trial):
    host, flags = trial.cycles["host_ns"], np.zeros(trial.t.size, np.uint32)
    flags[:25] = int(Flag.FT_SATURATED)
    columns = {"arm_ns": host + 500_000, "ft_ns": host - 1_000_000, "flags": flags}
    (health,) = summarised([as_left(trial, **columns)])
    assert health.skew == pytest.approx((1.5, 1.5, 1.5))
    assert health.skews.sum() == trial.t.size
    assert health.puck_degc == (30.0, 31.0, 33.0)
    assert health.motor_degc == ()
    assert health.saturated == pytest.approx(0.25)
    assert health.period == pytest.approx(2.0)
    assert health.tare == pytest.approx(tuple(trial.payload.bias[:3]))


def test_the_load_is_compared_with_its_setting(trial):
    (health,) = summarised([as_left(trial)])
    set_load = 0.3 * 9.81 * np.cos(FRAME.incline)
    assert health.load_bias == pytest.approx(
        np.median(trial.traction[:, 2]) - set_load, abs=1e-9
    )


def test_drag_is_the_power_lost_to_friction(trial):
    speeds = np.zeros((trial.t.size, 7))
    speeds[:, 1] = 0.1
    (health,) = summarised([as_left(trial, velocity=speeds)])
    power = 0.1 * CONSTANTS.coulomb[1]
    expected = np.median(power / np.abs(trial.traction[:, 0]))
    assert health.drag == pytest.approx(expected)


def test_a_tare_is_bracketed_by_the_next_of_its_session(trial):
    after = replace(as_left(trial, "T02"), payload=PAYLOAD.tared(BIAS + 0.3, np.eye(3)))
    first, second = summarised([as_left(trial), after])
    shift = after.payload.bias[:3] - trial.payload.bias[:3]
    assert first.tare_bracket == pytest.approx(np.linalg.norm(shift))
    assert second.tare_bracket is None
    # Both trials are of one session: what its tares show counts for both.
    assert first.force_uncertainty == second.force_uncertainty
    assert first.force_uncertainty > 0.1


def test_without_a_second_tare_the_floor_is_the_noise(trial):
    (alone,) = summarised([as_left(trial)])
    assert alone.force_uncertainty is None
    assert alone.floor == pytest.approx(np.sqrt(2 / np.pi) * alone.noise)


def test_the_largest_traction_follows_from_the_sensors_ranges(trial):
    ranged = as_left(trial)
    ranged.metadata["provenance"]["ft_sensor:ranges"] = "500 400 1200 15 12 12"
    # 12 N m over 0.112 m of foot is reached first
    assert summarised([ranged])[0].measurable_F_t == pytest.approx(12 / 0.112)
    assert summarised([as_left(trial)])[0].measurable_F_t is None
