"""F_t/F_n of trials and terrains."""

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.study.terrain_fit import TerrainResult


def trial_ratio(trial: PreparedTrial) -> float:
    """Return the ratio of mean F_t to mean F_n of a trial."""
    # not the mean of ratios, because single samples may have F_n near zero
    load = float(trial.F_n.mean())
    return float(trial.F_t.mean()) / load if load > 0 else float("nan")


def ratios_of(result: TerrainResult) -> Array:
    """Return the ratio of mean F_t to mean F_n of every trial of a terrain."""
    ratios = np.array([trial_ratio(trial) for trial in result.trials if trial.kept])
    return ratios[np.isfinite(ratios)]


def traction_ratio(result: TerrainResult) -> str:
    """Format F_t/F_n of a terrain: mean over its trials ± standard deviation.

    The value of a trial is its ratio of means. A dash without trials.
    """
    ratios = ratios_of(result)
    if not ratios.size:
        return "–"
    if ratios.size == 1:
        return f"{ratios[0]:.2f}"
    return f"{ratios.mean():.2f} ± {ratios.std(ddof=1):.2f}"
