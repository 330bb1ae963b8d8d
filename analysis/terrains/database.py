"""The terrain database on disk: fitted models of terrains in one file.

A JSON object, nothing that is executed; `terrain_db.schema.json` beside this module is
its JSON Schema:

    format "traction-terrain-db", version 2, made_utc, simulated,
    default (the model that answers), recogniser (the model of rho and limits)
    shares of the quantiles, increasing
    axes   F_n [N] and v_t [m/s], increasing, the points of every table
    terrains NAME: kind, trials, samples, rho (correlation of neighbouring residuals),
        limits {window: mean strain that 99 % of its own windows stay below},
        models MODEL: title, parameters, quantiles [N]: per share one row per F_n
        parts  NAME: anything else that is known of the terrain
    parts NAME: anything else that is known of all

Between the points of a table values are linear; outside of it they are those of its
edge. Version 1 had one mean and sd [N] for the quantiles of a model: it is still read,
as normal distributions.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, read_regular
from analysis.data.series import Array
from analysis.study.distribution import SHARES
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.parts import checked_parts
from analysis.terrains.table import Rows, Table, rows_of

FORMAT, VERSION = "traction-terrain-db", 2
_OLD = 1  # mean and sd instead of quantiles
_LARGEST = 6_000_000  # bytes; in memory it takes thirty times as much
_MOST = 1_000_000_000  # trials or samples
_MOST_POINTS = 400  # of an axis
_MOST_SHARES = 99
_MOST_TERRAINS = 200
_DIGITS = 5  # of a tabulated force


def load(path: Path | str) -> TerrainDatabase:
    """Return the database in a file.

    Raises:
        SettingsError: it cannot be read or is none.
    """
    path = Path(path)
    try:
        content = read_regular(path, _LARGEST, is_link_followed=True)
        return _database(json.loads(content))
    except UnfitFileError as error:
        raise _no_database(path, f"it {error}") from error
    except OSError as error:
        raise SettingsError(
            f"{path} cannot be read ({error.strerror}).",
            hint="Make it with: traction export --terrain-db FILE.",
        ) from error
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise _no_database(path, what) from error


def _no_database(path: Path, what: str) -> SettingsError:
    return SettingsError(
        f"{path} is not a terrain database: {what}.",
        hint="Make it with: traction export --terrain-db FILE.",
    )


class _Header(NamedTuple):
    """What all tables of a file share.

    Attributes:
        version: of the format.
        axes: F_n [N] and v_t [m/s].
        shares: of the quantiles.
        default: name of the model that answers.
        recogniser: name of the model of rho and limits.
    """

    version: int
    axes: tuple[tuple[float, ...], ...]
    shares: tuple[float, ...]
    default: str
    recogniser: str


def _database(content: Any) -> TerrainDatabase:  # noqa: ANN401
    version = content["version"]
    if content["format"] != FORMAT or version not in (_OLD, VERSION):
        raise ValueError("it is of another format or version")
    default = str(content["default"])
    header = _Header(
        version=version,
        axes=tuple(_axis(content["axes"][name]) for name in ("F_n", "v_t")),
        shares=SHARES if version == _OLD else _shares(content["shares"]),
        default=default,
        recogniser=default if version == _OLD else str(content["recogniser"]),
    )
    terrains = dict(content["terrains"])
    if not 0 < len(terrains) <= _MOST_TERRAINS:
        raise ValueError(f"{len(terrains)} terrains")
    return TerrainDatabase(
        {str(n): _terrain(str(n), t, header) for n, t in terrains.items()},
        bool(content["simulated"]),
        str(content["made_utc"]),
        checked_parts(content.get("parts", {})),
    )


def _terrain(
    name: str,
    content: Any,  # noqa: ANN401
    header: _Header,
) -> KnownTerrain:
    models = {str(key): dict(model) for key, model in dict(content["models"]).items()}
    for wanted in (header.default, header.recogniser):
        if wanted not in models:
            raise ValueError(f"{name} lacks the model {wanted}")
    return KnownTerrain(
        name=name,
        kind=str(content["kind"]),
        trials=_count(content["trials"]),
        samples=_count(content["samples"]),
        rho=_share(content["rho"]),
        limits={int(k): float(v) for k, v in dict(content["limits"]).items()},
        tables={key: _table(model, header) for key, model in models.items()},
        parameters={key: model["parameters"] for key, model in models.items()},
        default=header.default,
        titles={key: str(model.get("title", key)) for key, model in models.items()},
        recogniser=header.recogniser,
        parts=checked_parts(content.get("parts", {})),
    )


def _table(model: Mapping[str, Any], header: _Header) -> Table:
    axes = header.axes
    shape = (len(axes[0]), len(axes[1]))
    if header.version == _OLD:
        mean, sd = (_array(model[key], shape) for key in ("mean", "sd"))
        if bool((sd < 0.0).any()):
            raise ValueError("a standard deviation is negative")
        return Table.normal(axes[0], axes[1], mean, sd)
    forces = _array(model["quantiles"], (len(header.shares), *shape))
    if bool((np.diff(forces, axis=0) < 0.0).any()):
        raise ValueError("a larger share has a smaller quantile")
    return Table(axes[0], axes[1], header.shares, tuple(map(rows_of, forces)))


def _count(value: Any) -> int:  # noqa: ANN401
    number = int(value)
    if not 0 <= number <= _MOST:
        raise ValueError(f"trials or samples are not within 0..{_MOST}")
    return number


def _share(value: Any) -> float:  # noqa: ANN401
    number = float(value)
    if not 0.0 <= number < 1.0:
        raise ValueError(f"a correlation of {number}")
    return number


def _shares(values: Any) -> tuple[float, ...]:  # noqa: ANN401
    shares = np.array(values, dtype=np.float64)
    if shares.ndim != 1 or not 2 <= shares.size <= _MOST_SHARES:
        raise ValueError("there are no 2 to 99 shares")
    ends = np.concatenate([[0.0], shares, [1.0]])
    if not bool((np.diff(ends) > 0.0).all()):
        raise ValueError("the shares do not increase between 0 and 1")
    return tuple(shares.tolist())


def _axis(values: Any) -> tuple[float, ...]:  # noqa: ANN401
    axis = np.array(values, dtype=np.float64)
    if axis.ndim != 1 or not 2 <= axis.size <= _MOST_POINTS:
        raise ValueError("an axis needs 2 to 400 points")
    if not bool(np.isfinite(axis).all()) or not bool((np.diff(axis) > 0).all()):
        raise ValueError("an axis does not increase")
    return tuple(axis.tolist())


def _array(values: Any, shape: tuple[int, ...]) -> Array:  # noqa: ANN401
    table = np.array(values, dtype=np.float64)
    if table.shape != shape or not bool(np.isfinite(table).all()):
        size = " x ".join(map(str, shape))
        raise ValueError(f"a table is not {size} finite numbers")
    return table


def to_text(database: TerrainDatabase) -> str:
    """Return a database as the text of a file, in the current version.

    Raises:
        SettingsError: it has no terrain, terrains with different axes, or more than a
            file may have.
    """
    known = list(database.terrains.values())
    grids = {(t.F_n, t.v_t, t.shares) for k in known for t in k.tables.values()}
    if len(grids) != 1:
        raise SettingsError(
            f"{len(known)} terrains with {len(grids)} different grids make no file.",
            hint="Fit the terrains together, so that their tables agree.",
        )
    ((F_n, v_t, shares),) = grids
    content = {
        "format": FORMAT,
        "version": VERSION,
        "made_utc": database.made_utc,
        "simulated": database.is_simulated,
        "default": known[0].default,
        "recogniser": known[0].recogniser or known[0].default,
        "units": {"F_n": "N", "v_t": "m/s", "quantiles": "N", "shares": "1"},
        "shares": list(shares),
        "axes": {"F_n": list(F_n), "v_t": list(v_t)},
        "terrains": {terrain.name: _plain(terrain) for terrain in known},
        "parts": dict(database.parts),
    }
    text = json.dumps(content, default=str)
    if len(text.encode()) > _LARGEST:
        raise SettingsError(
            f"{len(known)} terrains make a file of {len(text) / 1e6:.1f} MB, larger "
            f"than the {_LARGEST / 1e6:.0f} MB that are read.",
            hint="Export fewer sessions at a time.",
        )
    return text


def _plain(terrain: KnownTerrain) -> dict[str, Any]:
    return {
        "kind": terrain.kind,
        "trials": terrain.trials,
        "samples": terrain.samples,
        "rho": terrain.rho,
        "limits": {str(size): limit for size, limit in terrain.limits.items()},
        "models": {
            name: {
                "title": terrain.titles.get(name, name),
                "parameters": terrain.parameters.get(name, {}),
                "quantiles": [_rounded(rows) for rows in table.forces],
            }
            for name, table in terrain.tables.items()
        },
        "parts": dict(terrain.parts),
    }


def _rounded(rows: Rows) -> list[list[float]]:
    return [[float(f"{value:.{_DIGITS}g}") for value in row] for row in rows]
