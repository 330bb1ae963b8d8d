"""Combination of joints, wrench and URDF: foot path and sensor readings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.logs.channels import (
    By,
    JointChannel,
    WrenchChannel,
    choose_topic,
    read_channels,
)
from analysis.logs.estimates import Bools
from analysis.logs.log_file import LogFile
from analysis.logs.messages import JOINT_STATE, WRENCH_STAMPED
from analysis.logs.motion import (
    JointMotion,
    joint_motion,
    mean_around,
    seconds_since,
)
from analysis.logs.robot import FramePath, RobotLeg

_OWN = "traction_msgs/Cycle"


@dataclass(frozen=True, slots=True)
class LegRecord:
    """Data from a log and a URDF before tare, lag and ground are applied.

    Attributes:
        joints: channel of the joints.
        wrench: channel of the wrench.
        motion: joints on an even grid.
        path: foot and sensor at every row.
        wrench_t: times of the readings [s of the log], shape (m,).
    """

    joints: JointChannel
    wrench: WrenchChannel
    motion: JointMotion
    path: FramePath
    wrench_t: Array

    @property
    def t(self) -> Array:
        """Time of the rows [s of the log], shape (n,)."""
        return self.motion.t

    def raw(self, lag: float) -> Array:
        """Return the readings at the times of the joints [N, N m], (n, 6); NaN in gaps.

        Raises:
            SettingsError: there is no reading at a time of the joints.
        """
        at, step = self.motion.t + lag, self.motion.step
        raw = mean_around(self.wrench_t, self.wrench.wrench, at, step)
        if not np.isfinite(raw).any():
            first, last = self.wrench_t[[0, -1]] - lag
            raise SettingsError(
                "No reading of the wrench lies at a time of the joints: the joints go "
                f"from 0 to {self.t[-1]:.1f} s, the wrench from {first:.1f} to "
                f"{last:.1f} s.",
                hint="State --clock receipt if the clocks differ, or another --lag.",
            )
        return raw


def record_of_leg(
    log: LogFile,
    leg: RobotLeg,
    joints: str | None,
    wrench: str | None,
    clock: By | None,
) -> LegRecord:
    """Read both topics of a log; raises SettingsError."""
    if any(topic.type_name == _OWN for topic in log.topics.values()):
        raise SettingsError(
            f"{log.path}: this is a trial of Traction: report, fit and export read it.",
            hint="Write: traction export SESSION --to DIR, then traction fit DIR.",
        )
    of_joints = choose_topic(log, JOINT_STATE, joints, "--joints")
    of_wrench = choose_topic(log, WRENCH_STAMPED, wrench, "--wrench")
    read_joints, read_wrench = read_channels(
        log, of_joints, leg.joints, of_wrench, clock
    )
    motion = joint_motion(read_joints)
    times = read_wrench.clock.times_ns
    origin_ns = int(read_joints.clock.times_ns[0])
    path = leg.along(motion.q, motion.qd)
    return LegRecord(
        read_joints, read_wrench, motion, path, seconds_since(times, origin_ns)
    )


def rows_within(t: Array, raw: Array, span: tuple[float, float]) -> Bools:
    """Return the rows within a time span [s] that have a reading, shape (n,)."""
    return (t >= span[0]) & (t <= span[1]) & np.isfinite(raw).all(axis=1)
