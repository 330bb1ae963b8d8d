"""How far the forces of a trial may be off, by the tares around the trials.

A tare of a second takes away the zero that the sensor has then. What the zero does
until the trial shows in how far the tares of a session are apart. With errors of
standard deviation s at a tare and in a trial, independent of each other, two tares are
sqrt(2) s apart, and so are a tare and a sample of the trial:

    sample  u = d                 d: rms change of an axis from tare to tare
    mean of a trial  u = d sqrt((1 + r) / 2)

r = 1/3 is the share of the variance that the mean of a trial keeps: a trial is some
five times as long as a sensor's drift remembers. With the zero on a line between two
tares their variance counts 2/3 in a sample and 1/2 in the mean. A zero that wanders
slowly and steadily is overstated: by half after one tare, up to twice between two.
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

_MEAN_KEEPS = 1.0 / 3.0  # of the variance of a sample, in the mean of a trial
_LINE_SAMPLE, _LINE_MEAN = 2.0 / 3.0, 1.0 / 2.0  # of a tare's variance, between two
_MEAN_ABSOLUTE = sqrt(2.0 / pi)  # of a normal error of standard deviation 1


@dataclass(frozen=True, slots=True)
class ForceUncertainty:
    """Standard uncertainties of F_t and F_n [N], the same for both.

    Attributes:
        brackets: pairs of tares that they are taken from.
        change: rms change of an axis from one tare to the next [N].
    """

    brackets: int
    change: float

    @property
    def sample(self) -> float:
        """Of one smoothed sample, without its white noise [N]."""
        return self.change

    @property
    def mean(self) -> float:
        """Of the mean over a trial [N]."""
        return self.change * sqrt((1.0 + _MEAN_KEEPS) / 2.0)

    @property
    def interpolated_sample(self) -> float:
        """Of one smoothed sample with the zero on a line between two tares [N]."""
        return self.change * sqrt((1.0 + _LINE_SAMPLE) / 2.0)

    @property
    def interpolated_mean(self) -> float:
        """Of the mean over a trial with the zero on a line between two tares [N]."""
        return self.change * sqrt((_MEAN_KEEPS + _LINE_MEAN) / 2.0)

    def floor(self, noise: float) -> float:
        """Return the mean absolute error that no model can be better than [N].

        Args:
            noise: standard deviation of smoothed F_t at rest [N].
        """
        return _MEAN_ABSOLUTE * sqrt(self.sample**2 + noise**2)


class TaredTrial(Protocol):
    """What the tares of a trial are known by; a recorded trial has it."""

    @property
    def path(self) -> Path:
        """The file, in the folder of its session."""
        ...

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata by name."""
        ...

    @property
    def payload(self) -> Payload:
        """Calibration and tare that were applied."""
        ...

    @property
    def bracket(self) -> TareBracket | None:
        """The tares before and after it; None where one is not known."""
        ...


def tare_changes(trials: Sequence[TaredTrial]) -> list[Array | None]:
    """Return how far the force's zero moved from the tare of each trial to the next.

    Of trials without a bracket the tare of the session's next trial counts. Shape (3,)
    [N]; None where no tare followed.
    """
    following: dict[int, Array] = {}
    for k, (first, second) in enumerate(pairwise(trials)):
        if _session(first) == _session(second):
            following[k] = second.payload.bias[:3] - first.payload.bias[:3]
    return [
        following.get(k) if trial.bracket is None else _of_force(trial.bracket)
        for k, trial in enumerate(trials)
    ]


def _of_force(bracket: TareBracket) -> Array:
    return bracket.change[:3]


def uncertainties_of(
    trials: Sequence[TaredTrial],
) -> Mapping[str, ForceUncertainty]:
    """Return the uncertainty of every session that has two tares, by its name."""
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
    """Return the uncertainty of the trial's session, None where it is not known."""
    return known.get(_session(trial))


def _session(trial: TaredTrial) -> str:
    """Return the session and its folder: numbers of sessions repeat between data."""
    folder = trial.path.parent.parent.name
    return f"{folder}/{trial.metadata['trial'].get('session', '')}"
