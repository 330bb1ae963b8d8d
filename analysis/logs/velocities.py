"""Velocities that a log states, held against those of its positions."""

from __future__ import annotations

import numpy as np

from analysis.data.series import Array
from analysis.logs.channels import JointChannel
from analysis.logs.motion import JointMotion, interpolated, seconds_since

_LONGEST = 0.05  # s that are looked at
LATEST = 0.004  # s
LARGEST_GAIN = 0.05
_LEAST = 0.02  # rad/s rms of a joint that is judged


def compare_velocities(channel: JointChannel, motion: JointMotion) -> list[str]:
    """Return what is wrong with the velocities of a log; they are not used.

    A driver's filter makes them late or small: then its forces may be late, too.
    """
    if channel.qd is None:
        return []
    times = seconds_since(channel.clock.times_ns, int(channel.clock.times_ns[0]))
    stated = interpolated(motion.t, times, channel.qd)
    rms = np.sqrt(np.mean(motion.qd**2, axis=0))
    joint = int(rms.argmax())
    if rms[joint] < _LEAST:
        return []
    lag, gain = _lag_and_gain(motion.qd[:, joint], stated[:, joint], motion.step)
    if abs(lag) <= LATEST and abs(gain - 1.0) <= LARGEST_GAIN:
        return []
    return [
        f"{channel.topic.name}: its velocities are {lag * 1e3:.0f} ms late and "
        f"{gain:.2f} times those of the positions; those of the positions are used"
    ]


def _lag_and_gain(true: Array, stated: Array, step: float) -> tuple[float, float]:
    """Return how late [s] and how large a velocity is against another one."""
    most = min(int(_LONGEST / step), len(true) // 4)
    inner = true[most : len(true) - most]
    gains = np.empty(2 * most + 1)
    rests = np.empty(2 * most + 1)
    for k in range(2 * most + 1):
        shifted = stated[k : k + len(inner)]
        gains[k] = float(shifted @ inner) / max(float(inner @ inner), 1e-30)
        rests[k] = float(np.sum((shifted - gains[k] * inner) ** 2))
    best = int(rests.argmin())
    return (best - most) * step, float(gains[best])
