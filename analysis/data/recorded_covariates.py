"""Columns of a recorded trial that may explain F_t beyond F_n and v_t."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from analysis.data.load import RecordedTrial
from analysis.data.series import Array, TractionSeries


def height(trial: RecordedTrial) -> Array:
    """Height of the sole above the plane [m], shape (n,); negative for sinkage."""
    return trial.frame.height(trial.sole)


def lateral(trial: RecordedTrial) -> Array:
    """Lateral force, perpendicular to the push [N], shape (n,)."""
    return trial.lateral


def tilt(trial: RecordedTrial) -> Array:
    """Pitch of the sole relative to the plane [rad], shape (n,)."""
    x_T, _, z_T = trial.frame.axes()
    normal = -trial.rotation[:, :, 2]
    return np.arctan2(normal @ x_T, normal @ z_T)


def moment(trial: RecordedTrial) -> Array:
    """Moment of the ground about the sensor's lateral axis [N m], shape (n,)."""
    raw = np.ascontiguousarray(trial.cycles["wrench_raw"])
    in_sensor = trial.payload.contact(raw, trial.rotation)[:, 3:]
    in_foot = in_sensor @ trial.payload.rotation.T
    return np.einsum("nij,nj->ni", trial.rotation, in_foot) @ trial.frame.axes()[1]


RECORDED: Mapping[str, Callable[[RecordedTrial], Array]] = {
    "height": height,
    "lateral": lateral,
    "tilt": tilt,
    "moment": moment,
}


def with_covariates(trial: RecordedTrial, names: Sequence[str]) -> TractionSeries:
    """Return a trial with the named columns of `RECORDED` as further inputs."""
    return replace(trial.series(), further={n: RECORDED[n](trial) for n in names})
