"""What was measured beside what was true, in simulated trials."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import TrialFileError
from acquisition.trial_file.reader import TrialReader
from analysis.data.load import RecordedTrial
from analysis.data.prepare import moving_average

_FEWEST = 50  # cycles, or a truth file is none of this trial
_WIDTH = 11  # of the moving average, as the models see the trial
_PREFIX = "true:"  # of the parameters in a truth file


@dataclass(frozen=True, slots=True)
class TruthErrors:
    """Errors of one trial after the same smoothing on both.

    Attributes:
        v_t: root mean square [m/s].
        F_t: mean absolute [N].
        F_n: mean absolute [N].
        parameters: of the simulated ground that were in force [SI], by name.
    """

    v_t: float
    F_t: float
    F_n: float
    parameters: Mapping[str, float] = field(default_factory=dict[str, float])


def truth_errors(trial: RecordedTrial) -> TruthErrors | None:
    """Return how far a trial is from its truth file; None where there is none."""
    path = trial.path.with_name(trial.path.stem + ".truth.mcap")
    if not path.exists():
        return None
    try:
        reader = TrialReader(path)
        truth = reader.truth().data
    except TrialFileError:
        return None
    if not len(truth):
        return None
    host_ns = trial.cycles["host_ns"]
    inside = (host_ns >= truth["host_ns"][0]) & (host_ns <= truth["host_ns"][-1])
    if np.count_nonzero(inside) < _FEWEST:
        return None
    t, t_true = host_ns[inside].astype(float), truth["host_ns"].astype(float)
    true = [np.interp(t, t_true, truth["traction"][:, k]) for k in range(3)]
    error = _smooth(trial.traction[inside]) - _smooth(np.column_stack(true))
    return TruthErrors(
        v_t=float(np.sqrt(np.nanmean(error[:, 0] ** 2))),
        F_t=float(np.nanmean(np.abs(error[:, 1]))),
        F_n=float(np.nanmean(np.abs(error[:, 2]))),
        parameters=_parameters(reader.metadata.get("trial", {})),
    )


def _parameters(facts: Mapping[str, str]) -> dict[str, float]:
    """Return the true parameters among the facts of a trial; no number, no entry."""
    found: dict[str, float] = {}
    for key, text in facts.items():
        if key.startswith(_PREFIX):
            try:
                found[key.removeprefix(_PREFIX)] = float(text)
            except ValueError:
                continue
    return found


def _smooth(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([moving_average(column, _WIDTH) for column in values.T])
