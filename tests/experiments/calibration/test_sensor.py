"""Calibrations of wrist sensor and container through the whole program."""

import re
from dataclasses import replace

import numpy as np
import pytest

import fakes.world.rig
from acquisition.errors import SettingsError
from acquisition.trial_file.reader import TrialReader
from experiments.calibration import sensor
from experiments.operator import auto_operator as operator
from experiments.run import pose_walk as walk
from experiments.settings.calibrations import with_calibrations
from experiments.settings.load import load_settings
from fakes.plant import hand
from fakes.plant.model import PlantOptions
from fakes.sensor.errors import FORCE_ERRORS as FORCE
from fakes.sensor.errors import TORQUE_ERRORS as TORQUE
from fakes.sensor.errors import SensorErrors
from fakes.world import plain_world
from ft_sensor.calibration.files import terrain_from_toml, terrain_to_toml
from ft_sensor.calibration.sensor_file import sensor_from_toml, sensor_to_toml
from ft_sensor.payload import TerrainFrame, payload_of
from tests.experiments.program import (
    only_session,
    run_short,
    traction,
    write_config,
)
from wam.calibration import poses as calibration_poses
from wam.model.constants import Body
from wam.model.tool import Tool

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

QUICK = ("--fake", "--fast", "--operator-script", "auto")
MASS, COM, ANGLE = 0.62, np.array([0.014, -0.006, 0.055]), np.radians(25.0)


class OtherRig(plain_world.FakeRig):
    """A rig whose sensor is turned and whose foot weighs otherwise than in rig.toml.

    The sensor also reads the reaction force.
    """

    is_in_the_air = True
    angle, sign = ANGLE, -1.0

    def __init__(self, scene, constants, tool, clock, options=None, network=None):
        foot = Body(MASS, COM, tool.foot.inertia)
        other = replace(tool, foot=foot, sensor_angle=self.angle, sensor_sign=self.sign)
        # Nothing touches the ground, so one step per cycle is fine enough.
        options = options or PlantOptions(substeps=1 if self.is_in_the_air else 4)
        super().__init__(scene, constants, other, clock, options, network)


class SteadyErrors(SensorErrors):
    """A sensor that hardly drifts: the errors of the method remain."""

    def __init__(self, rng):
        super().__init__(rng, *(_drifting(s, 0.02) for s in (FORCE, TORQUE)))


class DriftingErrors(SensorErrors):
    """A sensor that drifts five times as far as a sound one."""

    def __init__(self, rng):
        super().__init__(rng, *(_drifting(s, 5.0) for s in (FORCE, TORQUE)))


def _drifting(scale, factor):
    shares = dict.fromkeys(("creep", "hysteresis", "cross_talk"), 0.0)
    drift, walk = factor * scale.drift, factor * scale.walk
    return replace(scale, drift=drift, walk=walk, **shares)


def calibrate(what, folder, *options, rig=OtherRig, errors=SensorErrors):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plain_world, "FakeRig", rig)
        patch.setattr(fakes.world.rig, "SensorErrors", lambda rng, *_: errors(rng))
        patch.setattr(walk, "SETTLE", 0.2)
        patch.setattr(sensor, "AVERAGE", 0.4)
        patch.setattr(calibration_poses, "POINT_SPEED", 0.8)
        return traction("calibrate", what, *QUICK, "--data", folder, *options)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """(result of the command, file) of a calibration of another foot, turned sensor."""
    folder = tmp_path_factory.mktemp("sensor")
    out = folder / "ft_sensor.toml"
    options = ("--poses", 6, "--to", out)
    done = calibrate("sensor", folder, *options, errors=SteadyErrors)
    assert done.code == 0, done.err
    return done, out


def test_a_few_orientations_recover_payload_mounting_and_sign(calibrated):
    _, out = calibrated
    found = sensor_from_toml(out.read_text(), out.name)
    assert found.fit.mass == pytest.approx(MASS, abs=0.005)
    assert found.com_in_frame_7(0.012) == pytest.approx(COM, abs=0.002)
    assert found.fit.angle == pytest.approx(ANGLE, abs=np.radians(0.5))
    assert found.fit.sign == -1.0
    assert found.fit.residual < 0.05
    assert (found.foot, found.is_simulated) == ("tread", True)


def test_a_sensor_with_its_usual_drift_is_calibrated(tmp_path):
    out = tmp_path / "ft_sensor.toml"
    done = calibrate("sensor", tmp_path, "--poses", 6, "--to", out)
    assert done.code == 0, done.err
    fit = sensor_from_toml(out.read_text(), out.name).fit
    assert 0.05 < fit.residual < 0.3
    # 0.22 N of drift in each of six poses: 9 g, at 3 sigma.
    assert fit.mass == pytest.approx(MASS, abs=0.03)


def test_the_operator_sees_the_mounting_and_how_to_use_the_file(calibrated):
    done, out = calibrated
    assert "degrees about z7, sign -1" in done.out
    assert f'calibration = "{out.name}" in [ft_sensor] of rig.toml' in done.out
    assert done.out.rstrip().endswith("ARM: idle; it sinks slowly, support it.")


def test_a_calibration_is_written_as_it_is_read(calibrated):
    text = calibrated[1].read_text()
    assert sensor_to_toml(sensor_from_toml(text, "a.toml")) == text


def test_a_calibrated_foot_turned_in_the_air_shows_no_force(calibrated):
    found = sensor_from_toml(calibrated[1].read_text(), "ft_sensor.toml")
    truth = payload_of(Tool(Body(0.1, COM, np.eye(3)), *_foot_and_sole()))
    fitted = payload_of(
        Tool(
            Body(0.1, COM, np.eye(3)),
            Body(found.fit.mass, found.com_in_frame_7(0.012), np.eye(3)),
            np.zeros(3),
            0.012,
            found.fit.angle,
            found.fit.sign,
        )
    )
    rng = np.random.default_rng(1)
    turned, r = np.linalg.qr(rng.normal(size=(200, 3, 3)))
    turned *= np.sign(np.einsum("nii->ni", r))[:, None, :]
    turned[np.linalg.det(turned) < 0] *= -1.0
    shown = found.fit.bias + truth.sign * truth.weight(turned)
    left = replace(fitted, bias=found.fit.bias).contact(shown, turned)[:, :3]
    assert np.linalg.norm(left, axis=1).max() < 0.3


@pytest.mark.long
def test_drift_is_reported_and_refused_unless_forced(tmp_path):
    out = tmp_path / "ft_sensor.toml"
    options = ("--poses", 6, "--to", out)
    done = calibrate("sensor", tmp_path, *options, errors=DriftingErrors)
    assert done.code == 2
    assert "N rms unexplained (limit 0.3)" in done.err
    assert "drift" in done.err
    assert not out.exists()
    forced = calibrate("sensor", tmp_path, *options, "--force", errors=DriftingErrors)
    assert forced.code == 0
    assert out.exists()


def record_with(folder, calibrated, angle=ANGLE, sign=-1.0):
    """Record a trial with the calibration and a sensor of this `angle` and `sign`."""
    (folder / "ft_sensor.toml").write_text(calibrated[1].read_text())
    change = ("sign = 1 ", 'calibration = "ft_sensor.toml"\nsign = 1 ')
    config = write_config(folder, rig=change)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plain_world, "FakeRig", OtherRig)
        patch.setattr(OtherRig, "is_in_the_air", False)
        patch.setattr(OtherRig, "angle", angle)
        patch.setattr(OtherRig, "sign", sign)
        patch.setattr(walk, "SETTLE", 0.2)
        return run_short(config, folder / "data")


@pytest.mark.parametrize(
    "off",
    [
        90.0,
        pytest.param(-90.0, marks=pytest.mark.long),
        pytest.param(180.0, marks=pytest.mark.long),
    ],
)
def test_a_sensor_that_was_turned_since_its_calibration_is_refused(
    tmp_path, calibrated, off
):
    done = record_with(tmp_path, calibrated, ANGLE + np.radians(off))
    assert done.code == 3
    turned = re.search(r"as if the sensor were turned by (-?\d+) degrees", done.err)
    assert turned is not None
    away = (float(turned[1]) - off + 180.0) % 360.0 - 180.0
    assert abs(away) < 10.0
    assert "traction calibrate sensor" in done.err
    assert "ARM: idle; it sinks slowly, support it." in done.out
    assert not list((tmp_path / "data").rglob("*.mcap"))


def test_a_sensor_whose_sign_changed_since_its_calibration_is_refused(
    tmp_path, calibrated
):
    done = record_with(tmp_path, calibrated, sign=1.0)
    assert done.code == 3
    assert "traction calibrate sensor" in done.err


def test_a_session_uses_sensor_and_container_as_calibrated(tmp_path, calibrated):
    done = record_with(tmp_path, calibrated)
    assert done.code == 0, done.err
    assert "mounting verified" in done.out
    path = only_session(tmp_path / "data") / "trials" / "T01.mcap"
    # A wrong sign or angle makes it several newtons; drift and bias 0.3-0.5.
    assert force_error(path) < 1.0
    names = TrialReader(path).attachments
    assert "calibration:ft_sensor.toml" in names


def test_a_simulated_calibration_is_refused_on_the_real_rig(tmp_path, calibrated):
    settings = _settings_with(tmp_path, calibrated)
    with pytest.raises(SettingsError, match="measured on a simulated arm"):
        with_calibrations(settings, is_simulated=False)


def test_a_calibration_of_another_foot_is_refused(tmp_path, calibrated):
    (tmp_path / "foot.toml").write_text(calibrated[1].read_text())
    change = ("[feet.bare]\n", '[feet.bare]\ncalibration = "foot.toml"\n')
    settings = load_settings(write_config(tmp_path, rig=change))
    with pytest.raises(SettingsError, match="measured with foot tread"):
        with_calibrations(settings, is_simulated=True)


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("", "states no version"),
        ('version = "1.0"\n', "is missing"),
        ("mass = 1\n" * 2, "not a calibration of a wrist sensor"),
        ("x = [" * 3000, "not a calibration of a wrist sensor"),
    ],
)
def test_an_invalid_calibration_file_is_reported(text, cause):
    with pytest.raises(SettingsError, match=cause):
        sensor_from_toml(text, "ft_sensor.toml")


def test_a_missing_calibration_is_reported_with_what_to_do(tmp_path):
    change = ("sign = 1 ", 'calibration = "gone.toml"\nsign = 1 ')
    config = write_config(tmp_path, rig=change)
    done = run_short(config, tmp_path / "data")
    assert done.code == 2
    assert "gone.toml cannot be read" in done.err
    assert "traction calibrate sensor" in done.err


# --- the container --------------------------------------------------------------------


def touch(folder, terrain, *options):
    """Touch the four corners of a short container, faster than a real arm can follow.

    Hence its low friction.
    """
    out = folder / f"terrain_{terrain}.toml"
    config = write_config(folder, travel=0.2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(operator, "TOUCHES", 4)
        patch.setattr(operator, "TOUCH_SECONDS", 3.2)
        patch.setattr(hand, "_CAREFUL", 0.2)
        done = traction(
            *("calibrate", "terrain", "--terrain", terrain, *QUICK),
            *("--friction", 0.02),
            *("--data", folder, "--config", config, "--to", out, *options),
        )
    return done, out


def test_a_touched_plate_gives_incline_and_heading(tmp_path):
    done, out = touch(tmp_path, "TF")
    assert done.code == 0, done.err
    name, frame = terrain_from_toml(out.read_text())
    row = load_settings(tmp_path / "rig.toml").row("TF")
    assert name == "TF"
    assert np.degrees(frame.incline) == pytest.approx(row.incline_deg, abs=0.2)
    assert np.degrees(frame.heading) == pytest.approx(row.heading_deg, abs=1.0)
    assert frame.start == pytest.approx(row.far_end, abs=0.004)
    assert frame.travel == pytest.approx(row.travel, abs=0.004)
    assert "0.0 mm rms off the plane" in done.out


class TiltedRig(plain_world.FakeRig):
    """A rig whose container is two degrees steeper than the matrix states."""

    def __init__(self, scene, *rest, **options):
        frame = replace(scene.frame, incline=scene.frame.incline + np.radians(2.0))
        super().__init__(replace(scene, frame=frame), *rest, **options)


def test_a_container_with_another_incline_is_refused(tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plain_world, "FakeRig", TiltedRig)
        done, out = touch(tmp_path, "S10")
        assert done.code == 2
        assert "the matrix says 10.0 (limit 1.0)" in done.err
        assert "mm rms off the plane" in done.out
        assert not out.exists()


def test_a_calibrated_container_replaces_the_numbers_of_its_row(tmp_path):
    config = write_config(tmp_path, travel=0.2)
    row = load_settings(config).row("TF")
    frame = TerrainFrame(0.0, 0.02, (0.705, 0.001, 0.121), row.travel)
    text = terrain_to_toml("TF", frame, {"simulated": "true"})
    (tmp_path / "tf.toml").write_text(text)
    named = row.model_copy(update={"calibration": "tf.toml"})
    settings = load_settings(config).with_row(named)
    found = with_calibrations(settings, is_simulated=True)
    assert found.row("TF").far_end == pytest.approx((0.705, 0.001, 0.121))
    assert found.row("TF").heading_deg == pytest.approx(np.degrees(0.02))
    assert found.calibrations == {"calibration:tf.toml": text}


def _foot_and_sole():
    return Body(MASS, COM, np.eye(3)), np.zeros(3), 0.012, ANGLE, -1.0


def _settings_with(folder, calibrated):
    (folder / "ft_sensor.toml").write_text(calibrated[1].read_text())
    change = ("sign = 1 ", 'calibration = "ft_sensor.toml"\nsign = 1 ')
    return load_settings(write_config(folder, rig=change))


def force_error(path):
    """Mean absolute error of F_n in a simulated trial [N]."""
    measured = TrialReader(path).cycles().data
    truth = TrialReader(path.with_name("T01.truth.mcap")).truth().data
    t_ns = truth["host_ns"].astype(float)
    F_n = np.interp(measured["host_ns"], t_ns, truth["traction"][:, 2])
    inside = (measured["host_ns"] > t_ns[0]) & (measured["host_ns"] < t_ns[-1])
    return np.abs(measured["traction"][:, 2] - F_n)[inside].mean()
