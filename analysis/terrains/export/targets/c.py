"""C99 header: quantiles, slip risks, sampled paths and belief over terrains."""

from dataclasses import astuple
from importlib import resources

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.study.distribution import normal_scores
from analysis.study.slip_risk import BREAK_AWAY, BreakAwayModel
from analysis.terrains.export.exported import ExportedTerrain, TerrainExport
from analysis.terrains.export.folder import ExportTarget, Files
from analysis.terrains.export.names import shown
from analysis.terrains.export.rest_table import REST_POINTS, rest_distances, rest_risks
from analysis.terrains.recognition import TAU
from analysis.terrains.table import Table, TractionEstimates

HEADER = "traction_terrains.h"
_NORMAL_POINTS, _NORMAL_END = 513, 6.0
_WIDTH = 88  # columns


def _files(export: TerrainExport) -> Files:
    return {HEADER: "\n".join(_sections(export)).encode()}


def _sections(export: TerrainExport) -> list[str]:
    """Return the sections of the header; queries.h holds the query functions.

    A new query needs a function there and, for further data of a terrain, a member of
    `traction_terrain` and a line in `_terrain`.
    """
    queries = resources.files("analysis.terrains.export.targets") / "queries.h"
    return [
        _head(export),
        _constants(export),
        queries.read_text(),
        *(_terrain(terrain, export) for terrain in export.terrains),
        _set(export),
    ]


def _head(export: TerrainExport) -> str:
    real = "float" if export.is_float else "double"
    shares = export.terrains[0].table.shares
    listed = "\n".join(
        f"   traction_{t.identifier}_..: {shown(t.name)}, {t.known.trials} trials"
        for t in export.terrains
    )
    return f"""\
/* Traction of terrains for a controller; written by a program.
   {export.origin}.

{listed}

   Forces in N, velocities in m/s; a quantile is the F_t that is not reached with the
   probability of its share. Linear between points, clamped outside. Every function
   returns 0 inside the measured range, 1 if clamped, -1 if an argument is not finite
   (a risk is then 1, a force 0). No allocation, no library, no state but the
   caller's. */
#ifndef TRACTION_TERRAINS_H
#define TRACTION_TERRAINS_H

#ifdef __FAST_MATH__
#error "-ffast-math does not know what is finite"
#endif

#ifdef __cplusplus
extern "C" {{
#endif

typedef {real} traction_real;

#define TRACTION_SIMULATED {int(export.is_simulated)} /* {export.trials_are} */
#define TRACTION_TERRAINS {len(export.terrains)}
#define TRACTION_SHARES {len(shares)}
#define TRACTION_NORMAL_POINTS {_NORMAL_POINTS}
#define TRACTION_NORMAL_PER_UNIT {(_NORMAL_POINTS - 1) / _NORMAL_END!r}
#define TRACTION_REST_POINTS {REST_POINTS}
#define TRACTION_SAMPLES_AS_ONE {TAU!r} /* samples of a belief that count as one */
"""


def _constants(export: TerrainExport) -> str:
    from scipy.special import ndtr

    table = export.terrains[0].table
    normal = ndtr(np.linspace(0.0, _NORMAL_END, _NORMAL_POINTS))
    is_float = export.is_float
    return "\n".join(
        [
            _array("traction_shares", np.array(table.shares), is_float),
            _array("traction_scores", normal_scores(table.shares), is_float),
            _array("traction_F_n", np.array(table.F_n), is_float),
            _array("traction_v_t", np.array(table.v_t), is_float),
            _array("traction_normal_table", normal, is_float),
        ]
    )


def _terrain(terrain: ExportedTerrain, export: TerrainExport) -> str:
    name, is_float = f"traction_{terrain.identifier}", export.is_float
    forces = np.array(terrain.table.forces).transpose(1, 2, 0)
    known = terrain.known
    recogniser = known.tables[known.recogniser or known.default]
    parts = [
        f"/* {shown(terrain.name)}: {export.trials_are} */",
        _array(f"{name}_forces", forces, is_float),
        _array(f"{name}_moments", _moments(recogniser), is_float),
    ]
    rest = "0"
    if known.has_from_rest:
        parts.append(_rest(name, known.from_rest, is_float))
        rest = f"&{name}_from_rest"
    copula = "0"
    if known.copula is not None:
        values = _numbers(np.array(astuple(known.copula)), is_float)
        parts.append(f"static const traction_copula {name}_copula = {{{values}}};\n")
        copula = f"&{name}_copula"
    loads, speeds = len(terrain.table.F_n), len(terrain.table.v_t)
    grid = f"{loads}, {speeds}, traction_F_n, traction_v_t"
    parts.append(
        f"""\
static const traction_terrain {name}_terrain = {{
    "{shown(terrain.name)}",
    {{{grid}, {name}_forces}},
    {{{grid}, {name}_moments}},
    {_number(known.rho, is_float)},
    {rest},
    {copula},
}};

static inline int {name}_quantiles(traction_real F_n, traction_real v_t,
                                   traction_real out[TRACTION_SHARES])
{{
    return traction_quantiles(&{name}_terrain, F_n, v_t, out);
}}

static inline int {name}_quantile(traction_real F_n, traction_real v_t, int share,
                                  traction_real *F_t)
{{
    traction_real out[TRACTION_SHARES];
    int code = traction_quantiles(&{name}_terrain, F_n, v_t, out);
    int is_known = share >= 0 && share < TRACTION_SHARES;
    *F_t = is_known ? out[share] : (traction_real)0;
    return is_known ? code : -1;
}}

static inline int {name}_risk_sliding(traction_real F_t, traction_real F_n,
                                      traction_real v_t, traction_real *p)
{{
    return traction_risk_sliding(&{name}_terrain, F_t, F_n, v_t, p);
}}

static inline int {name}_risk_rest(traction_real F_t, traction_real F_n,
                                   traction_real *p)
{{
    return traction_risk_rest(&{name}_terrain, F_t, F_n, p);
}}

static inline int {name}_sample(traction_trial *trial, traction_real F_n,
                                traction_real v_t, traction_real dt,
                                traction_real normal, traction_real *F_t)
{{
    return traction_sample(&{name}_terrain, trial, F_n, v_t, dt, normal, F_t);
}}
"""
    )
    return "\n".join(parts)


def _rest(name: str, model: BreakAwayModel, is_float: bool) -> str:
    distances = rest_distances(model)
    per_step = (distances.size - 1) / (distances[-1] - distances[0])
    scalars = (model.law.level, model.law.slope, float(distances[0]), float(per_step))
    ranges = (model.loads, model.forces)
    pairs = ("{" + _numbers(np.array(ends), is_float) + "}" for ends in ranges)
    values = (
        str(int(model.kind == BREAK_AWAY)),
        *(_number(value, is_float) for value in scalars),
        *pairs,
        f"{name}_rest_table",
    )
    return "\n".join(
        [
            _array(f"{name}_rest_table", rest_risks(model), is_float),
            f"static const traction_rest {name}_from_rest = {{",
            *(f"    {value}," for value in values),
            "};\n",
        ]
    )


def _set(export: TerrainExport) -> str:
    listed = ",\n".join(
        f"    &traction_{t.identifier}_terrain" for t in export.terrains
    )
    return f"""\
static const traction_terrain *const traction_list[TRACTION_TERRAINS] = {{
{listed},
}};

/* Every terrain, for a belief. */
static const traction_set traction_all = {{TRACTION_TERRAINS, traction_list}};

#ifdef __cplusplus
}}
#endif
#endif
"""


def _moments(table: Table) -> Array:
    """Return mean and standard deviation [N] at the points of a table, (n, m, 2)."""
    shares, loads, speeds = np.shape(table.forces)
    forces = np.array(table.forces).reshape(shares, -1)
    estimates = TractionEstimates(
        table.shares, forces, np.zeros(forces.shape[1], dtype=np.bool_)
    )
    return np.stack([estimates.mean, estimates.sd], axis=1).reshape(loads, speeds, 2)


def _array(name: str, values: Array, is_float: bool) -> str:
    """Return the definition of a table of constants.

    Raises:
        SettingsError: a number is beyond single precision.
    """
    if is_float and bool((np.abs(values) > 1e37).any()):
        raise SettingsError(
            f"{name} has a number beyond single precision.",
            hint="Leave --float out. Nothing was written.",
        )
    words = _numbers(values.ravel(), is_float).split(", ")
    lines, line = [], "   "
    for word in words:
        if len(line) + len(word) + 2 > _WIDTH:
            lines.append(line)
            line = "   "
        line += f" {word},"
    body = "\n".join([*lines, line])
    return f"static const traction_real {name}[{values.size}] = {{\n{body}\n}};\n"


def _numbers(values: Array, is_float: bool) -> str:
    return ", ".join(_number(value, is_float) for value in values.ravel().tolist())


def _number(value: float, is_float: bool) -> str:
    if not is_float:
        return repr(float(value))
    text = f"{float(np.float32(value)):.9g}"
    return f"{text}f" if "." in text or "e" in text else f"{text}.0f"


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    first = export.terrains[0].identifier
    loads, speeds = export.terrains[0].table.F_n, export.terrains[0].table.v_t
    shares = ", ".join(f"{share:g}" for share in export.terrains[0].table.shares)
    return (
        f"`{HEADER}` needs no other file: C99 or C++, no library, no allocation.",
        f"`traction_{first}_quantiles(F_n, v_t, out)`: F_t [N] for shares {shares}.",
        "`.._risk_sliding(F_t, F_n, v_t, &p)` and `.._risk_rest(F_t, F_n, &p)`: "
        "P(slip), within 1e-5 of Python.",
        f"Measured: F_n {loads[0]:g}..{loads[-1]:g} N, v_t {speeds[0]:g}.."
        f"{speeds[-1]:g} m/s. Codes: 0 inside, 1 clamped, -1 not finite.",
        "`traction_evidence(&set, &belief, F_n, v_t, F_t)` every 10 ms of sliding, "
        "`traction_posterior` for the terrains.",
        "cc -std=c99 -pedantic -Wall -Wextra -Werror -ffreestanding -O2 -c yours.c",
    )


TARGET = ExportTarget("Terrains for a controller in C or C++", _files, _about)
