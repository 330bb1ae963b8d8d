"""The force that accelerates the foot, and trials without it."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from acquisition.trial_file.reader import TrialReader
from analysis.data.inertia import WINDOW, inertial_force
from analysis.data.load import load_trial
from analysis.report.sections.sensitivity import parse_choice
from ft_sensor.payload import payload_of
from tests.analysis.data.test_load import (
    BIAS,
    FORCE,
    MODEL,
    PAYLOAD,
    TOOL,
    Q,
    make_cycles,
    write,
)
from tests.experiments.program import only_session, run_short, write_config

T = np.arange(0, 2.0, 0.002)
SWING = 2 * np.pi * 3.0  # rad/s


def swung(t, amplitude=0.01):
    return amplitude * np.column_stack([np.sin(SWING * t), np.cos(SWING * t), 0 * t])


def test_the_force_is_mass_times_acceleration():
    force = inertial_force(T, swung(T), 0.5).force
    wanted = -0.5 * SWING**2 * swung(T)
    inner = slice(10, -10)
    assert force[inner] == pytest.approx(wanted[inner], abs=0.02 * np.abs(wanted).max())


def test_the_uncertainty_of_the_force_is_the_spread_of_repetitions():
    noise = np.random.default_rng(3).normal(0, 1e-5, (200, 300, 3))
    t = T[:300]
    forces = np.array([inertial_force(t, n, 0.5).force[150] for n in noise])
    stated = [inertial_force(t, n, 0.5).uncertainty for n in noise]
    assert np.median(stated) == pytest.approx(forces.std(), rel=0.1)


def test_lost_rows_are_not_an_acceleration():
    kept = np.delete(np.arange(T.size), [200, 201, 202, 450, 800])
    whole, holed = (inertial_force(t, swung(t), 0.5).force for t in (T, T[kept]))
    assert holed == pytest.approx(whole[kept], abs=0.02)


@pytest.mark.parametrize(
    "t",
    [
        np.arange(0, 2.0, 0.02),  # 50 Hz
        T[:8],
        np.concatenate([T[:100], T[:100] + 100.0]),
    ],
)
def test_samples_that_show_no_acceleration_are_refused(t):
    with pytest.raises(SettingsError, match="acceleration"):
        inertial_force(t, swung(t), 0.5)


@pytest.fixture(scope="module")
def shaken(tmp_path_factory):
    """A trial whose joints swing under a constant force."""
    cycles = make_cycles(400)
    t = np.arange(400) * 0.002
    swing = np.zeros((400, 7))
    swing[:, 3] = 0.01 * np.sin(SWING * t)
    cycles["position"] = Q + swing
    tared = PAYLOAD.tared(BIAS, np.eye(3))
    path = [MODEL.sole_pose(q) for q in cycles["position"]]
    from_sole = tared.rotation @ tared.com - TOOL.sole
    positions = np.array([position + turn @ from_sole for position, turn in path])
    acceleration = np.gradient(np.gradient(positions, t, axis=0), t, axis=0)
    for row, (_, turn), a in zip(cycles, path, acceleration, strict=True):
        felt = np.zeros(6)
        felt[:3] = (turn @ tared.rotation).T @ (FORCE - tared.mass * a)
        row["wrench_raw"] = tared.sign * (felt + tared.weight(turn)) + tared.bias
    return load_trial(write(tmp_path_factory.mktemp("shaken") / "T01.mcap", cycles))


def test_an_inertia_corrected_trial_has_only_the_ground_force(shaken):
    inner = slice(20, -20)
    kept = np.abs(shaken.force - FORCE)[inner].max()
    removed = np.abs(shaken.without_inertia().force - FORCE)[inner].max()
    assert kept > 0.3
    assert removed < 0.1 * kept


def test_the_inertial_force_does_not_depend_on_the_mounting(shaken):
    """The same foot below a sensor that was mounted at another angle."""
    turned = payload_of(replace(TOOL, sensor_angle=-0.8))
    mounted = replace(shaken.payload, rotation=turned.rotation, com=turned.com)
    other = replace(shaken, payload=mounted).inertial_force()
    assert other.force == pytest.approx(shaken.inertial_force().force, abs=1e-9)


def test_the_correction_is_reported_with_its_uncertainty(shaken):
    choice = parse_choice("inertia=removed")
    F_t = choice.series(shaken).F_t
    assert F_t[100] == pytest.approx(shaken.without_inertia().traction[100, 1])
    remark = choice.with_remark([shaken]).remark
    assert f"{WINDOW * 1e3:.0f} ms" in remark
    kept = parse_choice("inertia=kept")
    assert kept.series(shaken).F_t == pytest.approx(shaken.series().F_t)
    assert kept.with_remark([shaken]).remark == ""


def test_inertia_is_not_removed_from_a_table(shaken):
    with pytest.raises(SettingsError, match="tables have no"):
        parse_choice("inertia=removed").series(shaken.series())


@pytest.mark.slow
def test_inertia_correction_brings_a_simulated_trial_nearer_to_the_truth(tmp_path):
    config = write_config(tmp_path)
    data = tmp_path / "data"
    done = run_short(config, data, "S0", 1)
    assert done.code == 0, done.err
    path = only_session(data) / "trials" / "T01.mcap"
    trial = load_trial(path)
    truth = TrialReader(path.with_name("T01.truth.mcap")).truth().data
    t_ns, t_true_ns = trial.cycles["host_ns"].astype(float), truth["host_ns"]
    true = np.interp(t_ns, t_true_ns.astype(float), truth["traction"][:, 1])

    def error(chosen):
        """Return the spread of the error without the sensor's slow part [N]."""
        residual = chosen.traction[:, 1] - true
        return float(np.std(np.diff(np.convolve(residual, np.ones(5) / 5, "valid"))))

    assert error(trial.without_inertia()) < error(trial)
