"""Uncertainty of the forces of a trial from the tares around the trials.

A tare of one second removes the sensor's zero at that time. The later drift of the zero
shows in the differences between the tares of a session. With independent errors of
standard deviation s at a tare and in a trial, two tares differ by sqrt(2) s, and so do
a tare and a sample of the trial:

    sample  u = d                 d: rms change of an axis from tare to tare
    mean of a trial  u = d sqrt((1 + r) / 2)

r = 1/3 is the ratio of the variance of a trial's mean to that of a sample: a trial is
about five times as long as the correlation time of the drift. If the zero is
interpolated between two tares, their variance counts 2/3 in a sample and 1/2 in the
mean. A slow steady drift is overestimated: by half after one tare, up to twice between
two.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt
from pathlib import Path
from typing import Protocol

import numpy as np

from analysis.data.series import Array
from analysis.data.tare_bracket import TareBracket
from ft_sensor.payload import Payload

_MEAN_KEEPS = 1.0 / 3.0  # variance of a trial's mean relative to that of a sample
_LINE_SAMPLE, _LINE_MEAN = 2.0 / 3.0, 1.0 / 2.0  # weight of a tare's variance
_MEAN_ABSOLUTE = sqrt(2.0 / pi)  # of a normal error of standard deviation 1


@dataclass(frozen=True, slots=True)
class ForceUncertainty:
    """Standard uncertainties of F_t and F_n [N], the same for both.

    Attributes:
        brackets: number of pairs of tares used.
        change: rms change of an axis from one tare to the next [N].
    """

    brackets: int
    change: float

    @property
    def sample(self) -> float:
        """Uncertainty of one smoothed sample, without white noise [N]."""
        return self.change

    @property
    def mean(self) -> float:
        """Uncertainty of the mean over a trial [N]."""
        return self.change * sqrt((1.0 + _MEAN_KEEPS) / 2.0)

    @property
    def interpolated_sample(self) -> float:
        """Uncertainty of a sample with the zero interpolated between two tares [N]."""
        return self.change * sqrt((1.0 + _LINE_SAMPLE) / 2.0)

    @property
    def interpolated_mean(self) -> float:
        """Uncertainty of a trial's mean with the zero interpolated [N]."""
        return self.change * sqrt((_MEAN_KEEPS + _LINE_MEAN) / 2.0)

    def floor(self, noise: float) -> float:
        """Return the lower limit of the mean absolute error of any model [N].

        Args:
            noise: standard deviation of smoothed F_t at rest [N].
        """
        return _MEAN_ABSOLUTE * sqrt(self.sample**2 + noise**2)


class TaredTrial(Protocol):
    """Part of a recorded trial that its tares are derived from."""

    @property
    def path(self) -> Path:
        """Path of the file, in the folder of its session."""
        ...

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata by name."""
        ...

    @property
    def payload(self) -> Payload:
        """Applied calibration and tare."""
        ...

    @property
    def bracket(self) -> TareBracket | None:
        """Tares before and after the trial; None if one is not known."""
        ...


def tare_changes(trials: Sequence[TaredTrial]) -> list[Array | None]:
    """Return the change of the force zero from the tare of each trial to the next.

    For trials without a bracket the tare of the session's next trial is used. Shape
    (3,) [N]; None if no tare followed.
    """
    following: dict[int, Array] = {}
    for k, (first, second) in enumerate(pairwise(trials)):
        if _session(first) == _session(second):
            following[k] = second.payload.bias[:3] - first.payload.bias[:3]
    return [
        following.get(k) if trial.bracket is None else _force_change(trial.bracket)
        for k, trial in enumerate(trials)
    ]


def _force_change(bracket: TareBracket) -> Array:
    return bracket.change[:3]


def uncertainties_of(
    trials: Sequence[TaredTrial],
) -> Mapping[str, ForceUncertainty]:
    """Return the uncertainty of every session with at least two tares, by name."""
    changes: dict[str, list[Array]] = {}
    for trial, change in zip(trials, tare_changes(trials), strict=True):
        if change is not None:
            changes.setdefault(_session(trial), []).append(change)
    return {
        session: ForceUncertainty(len(rows), float(np.sqrt(np.mean(np.square(rows)))))
        for session, rows in changes.items()
    }


def uncertainty_of(
    trial: TaredTrial, known: Mapping[str, ForceUncertainty]
) -> ForceUncertainty | None:
    """Return the uncertainty of the trial's session; None if not known."""
    return known.get(_session(trial))


def _session(trial: TaredTrial) -> str:
    """Return folder and session; session numbers repeat between data folders."""
    folder = trial.path.parent.parent.name
    return f"{folder}/{trial.metadata['trial'].get('session', '')}"
