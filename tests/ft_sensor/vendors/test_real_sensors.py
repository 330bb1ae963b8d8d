"""Tares and forces of two real sensors agree with published values."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.devices import WrenchSample
from ft_sensor.payload import Payload
from ft_sensor.tare import TareError, take_mean

REAL = Path(__file__).parents[4] / "shared" / "data" / "real"
PRESS, CONTOUR = REAL / "granular_press_ft", REAL / "kuleuven_contour"
LIMIT = 0.5  # N
RATE = 100.0  # Hz, of the recorded Bota sensor
MOUNTINGS = {
    **dict.fromkeys("ac", (("x", 135.0),)),
    **dict.fromkeys("be", (("y", 180.0), ("x", 135.0))),
    "d": (("y", 90.0), ("x", 135.0)),
    "f": (("y", -90.0), ("x", 135.0)),
}

pytestmark = [
    pytest.mark.shared_data,
    pytest.mark.skipif(not REAL.is_dir(), reason="shared data are not here"),
]


def samples(name, start=0.0, stop=np.inf):
    """Return the wrench samples of a press between two times [s]."""
    table = np.loadtxt(PRESS / f"{name}.csv", delimiter=",", skiprows=1)
    table = table[(table[:, 0] >= start) & (table[:, 0] < stop)]
    return [
        WrenchSample(round((1.0 + i / RATE) * 1e9), i, tuple(row), 0, True, False)
        for i, row in enumerate(table[:, 2:])
    ]


def test_the_tare_of_a_real_sensor_removes_its_offset():
    rest = samples("zero")
    result = take_mean(rest, LIMIT, rate=RATE)
    assert result.wrench[:3] == pytest.approx((6.9, 42.1, 3.5), abs=0.15)
    noise = np.array([sample.wrench[:3] for sample in rest]).std(axis=0)
    assert all(0.045 < sd < 0.085 for sd in noise)


@pytest.mark.parametrize(("name", "peak"), [("smooth_1", 331), ("smooth_2", 305)])
def test_a_real_press_has_its_published_peak(name, peak):
    bias = np.array(take_mean(samples("zero"), LIMIT, rate=RATE).wrench)
    payload = Payload(0.0, np.zeros(3), np.eye(3), -1.0, bias)
    raw = np.array([sample.wrench for sample in samples(f"{name}_press")])
    force = payload.contact(raw, np.broadcast_to(np.eye(3), (len(raw), 3, 3)))
    F_n = force[:, 2]
    assert 300 < F_n.max() < 335
    assert F_n.max() == pytest.approx(peak, abs=15)
    assert abs(F_n[:50].mean()) < 1.6  # the wheel is in the air
    cross_talk = np.linalg.norm(force[F_n.argmax(), :2])
    assert cross_talk < 0.03 * F_n.max()


def test_a_press_is_not_accepted_as_a_tare():
    with pytest.raises(TareError, match="varied"):
        take_mean(samples("smooth_1_press"), LIMIT, rate=RATE)


def upright(*turns):
    """Return the product of elementary rotations (axis, degrees)."""
    from scipy.spatial.transform import Rotation

    product = Rotation.identity()
    for axis, angle in turns:
        product *= Rotation.from_euler(axis, angle, degrees=True)
    return product


def true_force(raw, letter):
    """Return (force of the tool [N], tool point [m], rows where the pose is new)."""
    from scipy.spatial.transform import Rotation

    up = upright(("x", 90))
    tracker = up * Rotation.from_quat(raw[:, 4:8], scalar_first=True)
    mounting = upright(*MOUNTINGS[letter]) * upright(("z", -90), ("x", 225)).inv()
    sensor = (tracker * mounting).as_matrix()
    # Zeroed upright: the weight of the tool was taken away with the offset.
    bias = np.array([0.0, 0.0, 0.2 * 9.81, 0.0, 0.0, 0.0])
    payload = Payload(0.2, np.zeros(3), np.eye(3), 1.0, bias)
    force = payload.to_base(payload.contact(raw[:, 8:14], sensor), sensor)
    arm = [0.0, -0.09969 if letter in "ab" else -0.26169, 0.0355]
    point = up.apply(raw[:, 1:4]) + tracker.apply(arm)
    is_new = np.r_[True, (np.diff(raw[:, 1:8], axis=0) != 0).any(axis=1)]
    return force, point, is_new


def resampled(grid, t, values):
    return np.array([np.interp(grid, t, column) for column in values.T]).T


@pytest.mark.parametrize("letter", "abcdef")
@pytest.mark.parametrize("number", [1, 2])
def test_forces_of_a_guided_tool_agree_with_the_published_ones(letter, number):
    from scipy.signal import savgol_filter

    raw = np.loadtxt(CONTOUR / f"contour_{letter}_{number}.dat", skiprows=1)
    published = np.loadtxt(
        CONTOUR / f"kuleuven_{letter}_{number}.csv", delimiter=",", skiprows=1
    )
    raw = raw[np.r_[True, np.diff(raw[:, 0]) > 0]]
    t, grid = raw[:, 0], published[:, 0]
    force, point, is_new = true_force(raw, letter)
    force = resampled(grid, t, force)
    path = resampled(grid, t[is_new], point[is_new])
    velocity = savgol_filter(path, 41, 2, deriv=1, delta=0.005, axis=0)
    along = velocity / np.linalg.norm(velocity, axis=1)[:, None]
    F_t = -(force * along).sum(axis=1)
    F_n = np.linalg.norm(force + F_t[:, None] * along, axis=1)
    error = np.array([F_n - published[:, 1], F_t - published[:, 3]])
    assert np.sqrt(np.mean(error**2, axis=1)).max() < 0.1
