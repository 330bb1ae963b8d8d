"""Soil of Project Chrono's SCM: what drags identify, each with its interval.

SCM shears by F_t / A = (c + F_n / A tan phi)(1 - exp(-j / K)) (Mohr and Coulomb, Janosi
and Hanamoto), A the area of the sole, and sinks by Bekker's law. Of that a database
knows the strength: the line F_t = a + F_n tan phi through the force that holds every
second push from rest, once for the law and once for each of its resampled trials;
c = a / A. What is not identified is absent, with the reason.
"""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np

from analysis.breakaway.model import BREAK_AWAY, INTERVAL, BreakAwayModel, PushLaw
from analysis.data.series import Array
from analysis.exports.folder import ExportTarget, Files
from analysis.exports.source import ExportedTerrain, TerrainExport

SOIL = "soil.json"
_LOADS = 9  # that a line is drawn through
_LEAST_RATIO = 1.5  # of the largest load over the smallest
_NEVER = {
    "Bekker_Kphi": "sinkage under a growing load was not recorded",
    "Bekker_Kc": "one sole has one width",
    "Bekker_n": "sinkage under a growing load was not recorded",
    "elastic_K": "unloading was not recorded",
    "damping_R": "unloading was not recorded",
}
_NO_SHEAR = "the way over which strength is mobilised is not in the database"


def _files(export: TerrainExport) -> Files:
    content = {
        "origin": export.origin,
        "simulated": export.is_simulated,
        "sole_area_m2": export.options.sole_area,
        "terrains": {
            t.name: soil_of(t, export.options.sole_area) for t in export.terrains
        },
    }
    return {SOIL: f"{json.dumps(content, indent=1)}\n".encode()}


def soil_of(terrain: ExportedTerrain, sole_area: float | None) -> dict[str, Any]:
    """Return the parameters of SCM that are identified, and why others are not.

    A further one, once a database has it, is a further entry here.
    """
    identified, absent = _strength(terrain, sole_area)
    return {
        "identifier": terrain.identifier,
        "identified": identified,
        "absent": {**absent, "Janosi_shear": _NO_SHEAR, **_NEVER},
    }


def _strength(
    terrain: ExportedTerrain, sole_area: float | None
) -> tuple[dict[str, Any], dict[str, str]]:
    both = ("Mohr_friction", "Mohr_cohesion")
    if not terrain.known.has_from_rest:
        return {}, dict.fromkeys(both, "the force before it slips is not known")
    model = terrain.known.from_rest
    low, high = model.loads
    if low <= 0.0 or high < _LEAST_RATIO * low:
        reason = f"pushed at {low:g} to {high:g} N only: no three loads apart"
        return {}, dict.fromkeys(both, reason)
    lines = _lines(model)
    degrees = np.degrees(np.arctan(lines[:, 1]))
    what = "break-away" if model.kind == BREAK_AWAY else "sliding at 5 to 20 mm/s"
    about = {"of": what, "loads_N": [low, high], "trials": model.trials}
    identified = {"Mohr_friction": {"unit": "deg", **_stated(degrees), **about}}
    absent: dict[str, str] = {}
    if lines[0, 0] <= 0.0:
        absent["Mohr_cohesion"] = f"the line meets F_n = 0 at {lines[0, 0]:.3g} N"
    elif sole_area is None:
        absent["Mohr_cohesion"] = (
            f"F_t at F_n = 0 is {lines[0, 0]:.3g} N; the area of the sole is not "
            "known: --sole-area"
        )
    else:
        pressure = _stated(lines[:, 0] / sole_area)
        identified["Mohr_cohesion"] = {"unit": "Pa", **pressure, **about}
    return identified, absent


def _lines(model: BreakAwayModel) -> Array:
    """Return a [N] and tan phi of the law and of every resampled one, shape (n, 2)."""
    F_n = np.linspace(*model.loads, _LOADS)
    design = np.column_stack([np.ones(F_n.size), F_n])
    laws = [model.law, *(PushLaw(*draw) for draw in model.draws.tolist())]
    forces = [replace(model, law=law).curve(F_n, 0.5) for law in laws]
    lines = np.linalg.lstsq(design, np.array(forces).T)[0].T
    return np.asarray(lines, dtype=np.float64)


def _stated(values: Array) -> dict[str, float]:
    """Return the value of all trials and the 90 % interval of resampled ones."""
    drawn = values[1:] if values.size > 1 else values
    low, high = np.quantile(drawn, INTERVAL)
    digits = {"value": values[0], "low": low, "high": high}
    return {k: float(f"{v:.4g}") for k, v in digits.items() if math.isfinite(v)}


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    return (
        f"`{SOIL}`: by terrain what was `identified` for SetSoilParameters, with 90 % "
        "intervals from resampled trials.",
        "`absent` names the other parameters and why: nothing here is from a textbook.",
        "Mohr_friction and Mohr_cohesion: the line through the force that holds every "
        "second push from rest.",
        "SetSoilParameters wants all eight: whoever fills in the others states where "
        "they are from.",
        "Grains as large as the tread are no continuum: SCM does not hold for them.",
        "GetCoefficientFriction of rigid terrains moves semi-empirical tyres only.",
    )


TARGET = ExportTarget("Soil for Project Chrono's SCM", _files, _about)
