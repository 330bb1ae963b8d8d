"""Terrain database on disk: fitted models of terrains in one file.

The file is a plain JSON object. `_File` is its model; the JSON Schema
`terrain_db.schema.json` next to this module describes every key.

Values are interpolated linearly between the points of a table and clamped to its edge
outside.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, field_validator

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, read_regular
from acquisition.validation import Entries, Many, first_problem
from analysis.data.recorded_factors import checked_factors
from analysis.data.series import Array
from analysis.study.slip_risk import BreakAwayModel
from analysis.terrains.classifier import SurfaceClassifier
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.path_copula import PathCopula
from analysis.terrains.table import Rows, Table

FORMAT, VERSION = "traction-terrain-db", "1.0"
LARGEST = 6_000_000  # bytes; in memory the content takes thirty times as much
_MOST = 1_000_000_000  # trials or samples
_MOST_POINTS = 400  # per axis
_MOST_SHARES = 99
_DIGITS = 5  # significant digits of a tabulated force


def _increasing(values: tuple[float, ...]) -> tuple[float, ...]:
    if not bool((np.diff(values) > 0.0).all()):
        raise ValueError("it does not increase")
    return values


_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Axis = Annotated[
    Many[_Finite],
    Field(min_length=2, max_length=_MOST_POINTS),
    AfterValidator(_increasing),
]
_Shares = Annotated[
    Many[Annotated[float, Field(gt=0.0, lt=1.0)]],
    Field(min_length=2, max_length=_MOST_SHARES),
    AfterValidator(_increasing),
]
_Rows = Many[Many[_Finite]]
_Count = Annotated[int, Field(ge=0, le=_MOST)]
_Factors = Annotated[dict[str, Any], AfterValidator(checked_factors)]


def _break_away(content: Any) -> BreakAwayModel | None:  # noqa: ANN401
    return None if content is None else BreakAwayModel.from_dict(content)


def _surfaces(content: Any) -> SurfaceClassifier | None:  # noqa: ANN401
    return None if content is None else SurfaceClassifier.from_dict(content)


class _Model(BaseModel):
    title: str | None = None
    parameters: Any
    quantiles: Many[_Rows]


class _Copula(BaseModel):
    level: float = Field(ge=0.0, le=1.0)
    tau_stick: float = Field(gt=0.0, allow_inf_nan=False)
    tau_slide: float = Field(gt=0.0, allow_inf_nan=False)


class _Terrain(BaseModel):
    kind: str
    incline_deg: float | None = Field(default=None, ge=-90, le=90)
    factors: _Factors = Field(default_factory=dict[str, Any])
    trials: _Count
    samples: _Count
    rho: float = Field(ge=0.0, lt=1.0)
    limits: Entries[int, float]
    models: Entries[str, _Model]
    roughness: Entries[int, _Finite] = Field(default_factory=dict[int, float])
    break_away: Annotated[Any, AfterValidator(_break_away)] = None
    copula: _Copula | None = None


class _Axes(BaseModel):
    F_n: _Axis
    v_t: _Axis


class _File(BaseModel):
    """Content of a database file; `units` is informative only."""

    format: Literal["traction-terrain-db"]
    version: Literal["1.0"]
    made_utc: str
    simulated: bool
    default: str
    recogniser: str
    units: Any = None
    shares: _Shares
    axes: _Axes
    terrains: Entries[str, _Terrain] = Field(min_length=1)
    surfaces: Annotated[Any, AfterValidator(_surfaces)] = None

    @field_validator("version", mode="before")
    @classmethod
    def _is_read(cls, version: object) -> object:
        if version != VERSION:
            raise ValueError(f"it is {version!r:.20}, and only {VERSION} is read")
        return version


def load(path: Path | str) -> TerrainDatabase:
    """Read a database file.

    Raises:
        SettingsError: the file cannot be read or is not a terrain database.
    """
    path = Path(path)
    try:
        content = read_regular(path, LARGEST, is_link_followed=True)
        return _database(_File.model_validate(json.loads(content)))
    except UnfitFileError as error:
        raise _no_database(path, f"it {error}") from error
    except OSError as error:
        raise SettingsError(
            f"{path} cannot be read ({error.strerror}).",
            hint="Make it with: traction export --terrain-db FILE.",
        ) from error
    except RecursionError as error:
        raise _no_database(path, str(error)) from error
    except ValueError as error:
        raise _no_database(path, first_problem(error)) from error


def _no_database(path: Path, what: str) -> SettingsError:
    return SettingsError(
        f"{path} is not a terrain database: {what}.",
        hint="Make it with: traction export --terrain-db FILE.",
    )


def _database(file: _File) -> TerrainDatabase:
    return TerrainDatabase(
        {
            name: _terrain(name, terrain, file)
            for name, terrain in file.terrains.items()
        },
        file.simulated,
        file.made_utc,
        file.surfaces,
    )


def _terrain(name: str, terrain: _Terrain, file: _File) -> KnownTerrain:
    models, copula = terrain.models, terrain.copula
    for model in (file.default, file.recogniser):
        if model not in models:
            raise ValueError(f"{name} lacks the model {model!r:.80}")
    return KnownTerrain(
        name=name,
        kind=terrain.kind,
        incline_deg=terrain.incline_deg,
        factors=terrain.factors,
        trials=terrain.trials,
        samples=terrain.samples,
        rho=terrain.rho,
        limits=terrain.limits,
        tables={key: _table(model, file) for key, model in models.items()},
        parameters={key: model.parameters for key, model in models.items()},
        default=file.default,
        titles={key: model.title or key for key, model in models.items()},
        recogniser=file.recogniser,
        roughness=terrain.roughness,
        break_away=terrain.break_away,
        copula=None if copula is None else PathCopula(**copula.model_dump()),
    )


def _table(model: _Model, file: _File) -> Table:
    F_n, v_t = file.axes.F_n, file.axes.v_t
    shape = (len(F_n), len(v_t))
    forces = _array(model.quantiles, (len(file.shares), *shape))
    if bool((np.diff(forces, axis=0) < 0.0).any()):
        raise ValueError("a larger share has a smaller quantile")
    return Table(F_n, v_t, file.shares, model.quantiles)


def _array(rows: tuple[Any, ...], shape: tuple[int, ...]) -> Array:
    table = np.array(rows, dtype=np.float64)
    if table.shape != shape:
        size = " x ".join(map(str, shape))
        raise ValueError(f"a table is not {size} finite numbers")
    return table


def to_text(database: TerrainDatabase) -> str:
    """Serialise a database as the text of a file.

    Raises:
        SettingsError: the database has no terrain, terrains with different axes, or is
            too large for a file.
    """
    terrains = list(database.terrains.values())
    grids = {(t.F_n, t.v_t, t.shares) for k in terrains for t in k.tables.values()}
    if len(grids) != 1:
        raise SettingsError(
            f"{len(terrains)} terrains with {len(grids)} different grids do not fit in "
            "one file.",
            hint="Fit the terrains together, so that their tables agree.",
        )
    ((F_n, v_t, shares),) = grids
    surfaces = database.surfaces
    file = _File.model_construct(
        format=FORMAT,
        version=VERSION,
        made_utc=database.made_utc,
        simulated=database.is_simulated,
        default=terrains[0].default,
        recogniser=terrains[0].recogniser or terrains[0].default,
        units={"F_n": "N", "v_t": "m/s", "quantiles": "N", "shares": "1"},
        shares=shares,
        axes=_Axes.model_construct(F_n=F_n, v_t=v_t),
        terrains={terrain.name: _stored(terrain) for terrain in terrains},
        surfaces=None if surfaces is None else surfaces.to_dict(),
    )
    text = json.dumps(file.model_dump(), default=str)
    if len(text.encode()) > LARGEST:
        raise SettingsError(
            f"{len(terrains)} terrains make a file of {len(text) / 1e6:.1f} MB, larger "
            f"than the {LARGEST / 1e6:.0f} MB that are read.",
            hint="Export fewer sessions at a time.",
        )
    return text


def _stored(terrain: KnownTerrain) -> _Terrain:
    break_away, copula = terrain.break_away, terrain.copula
    return _Terrain.model_construct(
        kind=terrain.kind,
        incline_deg=terrain.incline_deg,
        factors=dict(terrain.factors),
        trials=terrain.trials,
        samples=terrain.samples,
        rho=terrain.rho,
        limits=terrain.limits,
        models={
            name: _Model.model_construct(
                title=terrain.titles.get(name, name),
                parameters=terrain.parameters.get(name, {}),
                quantiles=tuple(map(_rounded, table.forces)),
            )
            for name, table in terrain.tables.items()
        },
        roughness=terrain.roughness,
        break_away=None if break_away is None else break_away.to_dict(),
        copula=None if copula is None else _Copula.model_construct(**asdict(copula)),
    )


def _rounded(rows: Rows) -> Rows:
    return tuple(tuple(float(f"{v:.{_DIGITS}g}") for v in row) for row in rows)
