"""Columns of a recorded trial that may tell more of F_t than F_n and v_t do."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from analysis.data.load import RecordedTrial
from analysis.data.series import Array, TractionSeries


def height(trial: RecordedTrial) -> Array:
    """Return how high the sole is above the plane [m], shape (n,); sinkage is below."""
    return trial.frame.height(trial.sole)


def lateral(trial: RecordedTrial) -> Array:
    """Return the force across the push [N], shape (n,)."""
    return trial.lateral


def tilt(trial: RecordedTrial) -> Array:
    """Return the pitch of the sole against the plane [rad], shape (n,)."""
    x_T, _, z_T = trial.frame.axes()
    normal = -trial.rotation[:, :, 2]
    return np.arctan2(normal @ x_T, normal @ z_T)


def moment(trial: RecordedTrial) -> Array:
    """Return the ground's moment about the sensor across the push [N m], (n,)."""
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
    """Return a trial with columns of `RECORDED` as its further inputs."""
    return replace(trial.series(), further={n: RECORDED[n](trial) for n in names})
