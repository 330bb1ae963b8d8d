"""Pure functions of JAX, and the numbers of the terrains beside them."""

import json
from typing import Any

import numpy as np

from analysis.breakaway.model import BREAK_AWAY
from analysis.exports.folder import ExportTarget, Files
from analysis.exports.rest import rest_distances, rest_risks
from analysis.exports.source import ExportedTerrain, TerrainExport
from analysis.exports.templates.text import template
from analysis.terrains.generator import KNOTS, Generator
from analysis.terrains.table import normal_scores

MODULE, NUMBERS = "traction_jax.py", "terrains.json"


def _files(export: TerrainExport) -> Files:
    content = {
        "origin": export.origin,
        "simulated": export.is_simulated,
        "terrains": {t.name: _numbers(t) for t in export.terrains},
    }
    return {
        MODULE: template(MODULE, export),
        NUMBERS: json.dumps(content).encode(),
    }


def _numbers(terrain: ExportedTerrain) -> dict[str, Any]:
    """Return the fields of `TerrainParams`; a further one is a further key."""
    table, profile = terrain.table, terrain.profile
    rest: dict[str, Any] = {
        "rest_law": [0.0, 0.0, 0.0],
        "rest_distances": [],
        "rest_risks": [],
    }
    if terrain.known.has_from_rest:
        model = terrain.known.from_rest
        rest = {
            "rest_law": [
                float(model.kind == BREAK_AWAY),
                model.law.level,
                model.law.slope,
            ],
            "rest_distances": rest_distances(model).tolist(),
            "rest_risks": rest_risks(model).tolist(),
        }
    return {
        "F_n": table.F_n,
        "v_t": table.v_t,
        "forces": np.array(table.forces).transpose(1, 2, 0).tolist(),
        "scores": normal_scores(table.shares).tolist(),
        "shares": table.shares,
        "mu_shares": profile.shares,
        "mu": profile.mu,
        **rest,
        "contact": [*terrain.known.contact.numbers]
        if terrain.known.has_contact
        else [],
        "sample": _sample(terrain.known.generator)
        if terrain.known.has_generator
        else None,
    }


def _sample(generator: Generator) -> dict[str, Any]:
    """Return the fields of `SampleParams`."""
    experts, bands = generator.experts, generator.bands
    return {
        "weights": experts.weights.tolist(),
        "sd": experts.sd.tolist(),
        "gate": experts.gate.tolist(),
        "centre": experts.centre.tolist(),
        "scale": experts.scale.tolist(),
        "knots": KNOTS,
        "drift": generator.drift.tolist(),
        "F_n": bands.F_n,
        "v_t": bands.v_t,
        "bands": np.array(bands.forces).transpose(1, 2, 0).tolist(),
        "level": [generator.between, float(generator.freedom)],
        "ends": [generator.least, generator.most],
    }


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    table = export.terrains[0].table
    shares = ", ".join(f"{share:g}" for share in table.shares)
    return (
        f"`{MODULE}` needs JAX alone; `load()` reads `{NUMBERS}` beside it, by name of "
        "the terrain.",
        f"`quantiles(params, F_n, v_t)`: F_t [N] for shares {shares}.",
        "`risk_sliding(params, F_t, F_n, v_t)`, `risk_rest(params, F_t, F_n)`: "
        "P(slip).",
        "`sample_mu(params, key, shape)`: coefficients of friction, one an episode; "
        "`contact_step(params, jam, dt, x, v, F_n, draw)`: the contact law; "
        "`sample(params, F_n, v_t, key)`: F_t along a motion of rows every 10 ms.",
        f"Clamped to F_n {table.F_n[0]:g}..{table.F_n[-1]:g} N, v_t "
        f"{table.v_t[0]:g}..{table.v_t[-1]:g} m/s; nothing says that it was. NaN stays "
        "NaN.",
        "jit, vmap and grad safe; float32 unless jax_enable_x64, within 1e-5 of the "
        "largest force.",
    )


TARGET = ExportTarget("Terrains as pure functions of JAX", _files, _about)
