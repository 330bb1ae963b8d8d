"""Databases of two terrains like those of a study, and many points."""

from math import log

import numpy as np

from analysis.study.distribution import (
    SHARES,
    NewTrialPrediction,
    normal_scores,
)
from analysis.study.slip_risk import BREAK_AWAY, SLIDING, BreakAwayModel, PushLaw
from analysis.terrains.database import to_text
from analysis.terrains.export.exported import TerrainExport
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.path_copula import PathCopula
from analysis.terrains.table import Table, rows_of
from tests.analysis.terrains.tables import normal_table

UTC = "2027-01-15T08:00:00Z"
DIGEST = "0123456789abcdef" * 4
F_N = tuple(np.round(np.linspace(-0.2, 12.4, 24), 6).tolist())
V_T = tuple(np.round(np.geomspace(0.005, 0.2, 20), 8).tolist())
LEVEL_SD = {"S0": 0.5, "TF": 0.3}
COPULA = {"S0": PathCopula(0.3, 0.6, 0.15), "TF": PathCopula(0.9, 2.0, 0.05)}
SKEW = {"S0": 0.4, "TF": 0.0}


def median_force(name):
    """Return F_50 over the grid [N], with a bump that no plane has."""
    F_n, v_t = np.meshgrid(F_N, V_T, indexing="ij")
    if name == "TF":
        return 0.85 * F_n + 0.3 + 0.5 * np.tanh(30.0 * v_t)
    return 1.5 + 0.6 * F_n + np.sin(1.3 * F_n) * np.exp(-10.0 * v_t)


def new_trial(name, median):
    size = np.full(median.size, 1.0)
    within = {"S0": 2.2, "TF": 0.15}[name] ** 2 * size
    scores = normal_scores(SHARES)
    skewed = scores + SKEW[name] * (scores**2 - 1.0) / 2.0
    return NewTrialPrediction.of(
        median.ravel(), within, LEVEL_SD[name] ** 2 * size, tuple(skewed)
    )


def from_rest(name, *, seed=1):
    """Return a law of break-away on stones, of sliding on a plate."""
    rng = np.random.default_rng(seed)
    kind = SLIDING if name == "TF" else BREAK_AWAY
    level, slope, spread, sd = (
        (0.5, 0.8, 0.2, 0.1) if name == "TF" else (log(7.0), 0.55, 0.3, 0.15)
    )
    draws = np.array([level, slope, spread, sd]) * rng.normal(1.0, 0.05, (60, 4))
    return BreakAwayModel(
        kind=kind,
        law=PushLaw(level, slope, spread, sd),
        draws=draws,
        v_slip=0.06,
        slips=30,
        held=40,
        trials=10,
        loads=(1.2, 7.5),
        forces=(0.8, 11.0),
    )


def terrain(kind, name=None):
    """Return a terrain like the paper's S0 or TF, under a name of its own."""
    median = median_force(kind)
    shape = (len(SHARES), *median.shape)
    forces = new_trial(kind, median).quantiles(SHARES).reshape(shape)
    table = Table(F_N, V_T, SHARES, tuple(map(rows_of, forces)))
    sd = np.full(median.shape, {"S0": 2.3, "TF": 0.33}[kind])
    normal = normal_table(F_N, V_T, median, sd)
    parameters = {
        "theta": {"log_sf": 1.0, "log_sc": log(LEVEL_SD[kind])},
        "trials": 10,
    }
    return KnownTerrain(
        name=name or kind,
        kind={"S0": "small", "TF": "flat"}[kind],
        trials=10,
        samples=9000,
        rho=0.97,
        limits={100: 3.0},
        tables={"gp_se": normal, "gp_se_trial": table},
        parameters={"gp_se": {}, "gp_se_trial": parameters},
        default="gp_se_trial",
        titles={"gp_se": "GP (SE)", "gp_se_trial": "GP (SE, new trial)"},
        recogniser="gp_se",
        break_away=from_rest(kind),
        copula=COPULA[kind],
    )


def database(*, is_simulated=True, names=("S0", "TF")):
    known = [terrain(k, n) for k, n in zip(("S0", "TF"), names, strict=True)]
    return TerrainDatabase({t.name: t for t in known}, is_simulated, UTC)


def export(*, is_simulated=True, names=("S0", "TF"), is_float=False):
    return TerrainExport.of(
        database(is_simulated=is_simulated, names=names),
        DIGEST,
        "1.2.3",
        is_float=is_float,
    )


def database_file(folder, **about):
    path = folder / "terrains.json"
    path.write_text(to_text(database(**about)))
    return path


def points(count=100_000, seed=3):
    """Return F_n [N] and v_t [m/s]: random ones, the grid, edges, points outside."""
    rng = np.random.default_rng(seed)
    F_n = rng.uniform(F_N[0] - 3.0, F_N[-1] + 5.0, count)
    v_t = np.exp(rng.uniform(np.log(0.001), np.log(0.6), count))
    on_grid = np.array(np.meshgrid(F_N, V_T)).reshape(2, -1)
    far = np.array(np.meshgrid([-1e6, -0.0, 0.0, 1e6, 1e300], [-1.0, 0.0, 1e300]))
    special = np.concatenate([on_grid, far.reshape(2, -1)], axis=1)
    F_n[: special.shape[1]], v_t[: special.shape[1]] = special
    return F_n, v_t
