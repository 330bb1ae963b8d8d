"""The terrain database: fitted models of terrains in one file for other programs.

A JSON object, nothing that is executed:

    format "traction-terrain-db", version 1, made_utc, simulated, default (a model)
    axes   F_n [N] and v_t [m/s], increasing, the points of every table
    terrains NAME: kind, trials, samples, rho (correlation of neighbouring residuals),
        limits {window: mean strain that 99 % of its own windows stay below},
        models MODEL: title, parameters, mean [N] and sd [N], one row per F_n
        parts  NAME: anything else that is known of the terrain
    parts NAME: anything else that is known of all

Between the points of a table values are linear; outside of it they are those of its
edge. `load` checks everything before it believes it.
"""

import json
import math
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import SettingsError
from analysis.breakaway import BreakAwayModel, BreakAwayRisk
from analysis.data import Array
from analysis.study import Prediction
from analysis.terrains.parts import Parts, break_away_in, checked_parts
from analysis.terrains.table import SlipRisk, Table, TractionEstimate, TractionEstimates

FORMAT, VERSION = "traction-terrain-db", 1
_LARGEST = 6_000_000  # bytes; in memory it takes thirty times as much
_MOST = 1_000_000_000  # trials or samples
_MOST_POINTS = 400  # of an axis
_MOST_TERRAINS = 200


@dataclass(frozen=True, slots=True)
class KnownTerrain:
    """One terrain of a database.

    Attributes:
        name: of the terrain.
        kind: "small", "big", "flat" or a word of its own.
        trials: it was fitted to so many trials,
        samples: with so many samples.
        rho: correlation of its residuals from one kept sample to the next.
        limits: mean strain by window size that its own windows stay below.
        tables: by name of the model.
        parameters: of every model, as fitted.
        default: name of the model that answers.
        parts: what else is known of it, by name; see `analysis.terrains.parts`.
    """

    name: str
    kind: str
    trials: int
    samples: int
    rho: float
    limits: Mapping[int, float]
    tables: Mapping[str, Table]
    parameters: Mapping[str, Any]
    default: str
    parts: Parts = field(default_factory=dict)

    def predict(self, F_n: float, v_t: float, model: str = "") -> TractionEstimate:
        """Return the traction to expect.

        Args:
            F_n: normal force [N].
            v_t: slip velocity [m/s].
            model: name of a model; "" = the default.

        Raises:
            SettingsError: there is no such model, or a value is no finite number.
        """
        _check_finite(F_n=F_n, v_t=v_t)
        table = self._table(model)
        return TractionEstimate(*table.at(F_n, v_t), not table.covers(F_n, v_t))

    def predict_many(
        self, F_n: Array, v_t: Array, model: str = ""
    ) -> TractionEstimates:
        """Return the same for many points, shape (n,).

        Raises:
            SettingsError: there is no such model, or a value is no finite number.
        """
        if not (np.isfinite(F_n).all() and np.isfinite(v_t).all()):
            raise SettingsError("F_n and v_t have to be finite numbers.")
        table, loads, speeds = self._table(model), np.asarray(F_n), np.asarray(v_t)
        mean, sd, _ = table.over(loads, speeds)
        return TractionEstimates(mean, sd, ~table.covers_many(loads, speeds))

    def prediction(self, F_n: Array, v_t: Array) -> Prediction:
        """Return the default model's answer as a model of the study gives it."""
        return self._table("").over(F_n, v_t)

    def slip_risk(self, required: float, F_n: float) -> BreakAwayRisk:
        """Return `BreakAwayModel.slip_risk`: of a push from rest at a load F_n [N].

        Raises:
            SettingsError: a value is negative or no finite number, or it is not known.
        """
        return self.from_rest.slip_risk(required, F_n)

    @property
    def from_rest(self) -> BreakAwayModel:
        """What it gives before it slips; read anew every time.

        Raises:
            SettingsError: it is not known.
        """
        return break_away_in(self.parts, self.name)

    def risk_in_motion(self, required: float, F_n: float, v_t: float = 0.0) -> SlipRisk:
        """Return the probability that a sliding foot meets less than `required` [N].

        Velocities below the slowest one that was measured count as that. A load or
        velocity outside the table is marked by `is_extrapolated` of the answer.

        Raises:
            SettingsError: a value is no finite number.
        """
        _check_finite(required=required, F_n=F_n, v_t=v_t)
        table = self._table("")
        mean, sd = table.at(F_n, v_t)
        risk = 0.5 * math.erfc((mean - required) / (math.sqrt(2.0) * max(sd, 1e-9)))
        is_covered = table.covers(F_n, max(v_t, table.v_t[0]))
        return SlipRisk(risk, is_extrapolated=not is_covered)

    def _table(self, model: str) -> Table:
        table = self.tables.get(model or self.default)
        if table is None:
            raise SettingsError(
                f"{self.name}: there is no model {model!r}.",
                hint=f"Models: {', '.join(self.tables)}.",
            )
        return table


def _check_finite(**values: float) -> None:
    """Refuse a value that no table can be asked for.

    Raises:
        SettingsError: one is no finite number.
    """
    for name, value in values.items():
        if not math.isfinite(value):
            raise SettingsError(f"{name} = {value} is no finite number.")


@dataclass(frozen=True, slots=True)
class TerrainDatabase:
    """Terrains by name.

    Attributes:
        terrains: every terrain.
        is_simulated: the trials were simulated.
        made_utc: when.
        parts: what else is known of all of them, by name.
    """

    terrains: Mapping[str, KnownTerrain]
    is_simulated: bool
    made_utc: str
    parts: Parts = field(default_factory=dict)

    def terrain(self, name: str) -> KnownTerrain:
        """Return a terrain.

        Raises:
            SettingsError: there is none of that name.
        """
        if name not in self.terrains:
            raise SettingsError(
                f"There is no terrain {name!r} in the database.",
                hint=f"Terrains: {', '.join(self.terrains)}.",
            )
        return self.terrains[name]


def load(path: Path | str) -> TerrainDatabase:
    """Return the database in a file.

    Raises:
        SettingsError: it cannot be read or is none.
    """
    path = Path(path)
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise ValueError("it is no regular file")
        if status.st_size > _LARGEST:
            raise ValueError(f"it is larger than {_LARGEST / 1e6:.0f} MB")
        return _database(json.loads(path.read_bytes()))
    except OSError as error:
        raise SettingsError(
            f"{path} cannot be read ({error.strerror}).",
            hint="Make it with: traction export --terrain-db FILE.",
        ) from error
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise SettingsError(
            f"{path} is no terrain database: {what}.",
            hint="Make it with: traction export --terrain-db FILE.",
        ) from error


def _database(content: Any) -> TerrainDatabase:  # noqa: ANN401
    if content["format"] != FORMAT or content["version"] != VERSION:
        raise ValueError("it is of another format or version")
    axes = tuple(_axis(content["axes"][name]) for name in ("F_n", "v_t"))
    terrains = dict(content["terrains"])
    if not 0 < len(terrains) <= _MOST_TERRAINS:
        raise ValueError(f"{len(terrains)} terrains")
    default = str(content["default"])
    return TerrainDatabase(
        {str(n): _terrain(str(n), t, axes, default) for n, t in terrains.items()},
        bool(content["simulated"]),
        str(content["made_utc"]),
        checked_parts(content.get("parts", {})),
    )


def _terrain(
    name: str,
    content: Any,  # noqa: ANN401
    axes: tuple[tuple[float, ...], ...],
    default: str,
) -> KnownTerrain:
    models = dict(content["models"])
    if default not in models:
        raise ValueError(f"{name} lacks the model {default}")
    shape = (len(axes[0]), len(axes[1]))
    tables = {
        str(key): Table(
            axes[0],
            axes[1],
            _rows(model["mean"], shape, least=-np.inf),
            _rows(model["sd"], shape, least=0.0),
        )
        for key, model in models.items()
    }
    return KnownTerrain(
        name=name,
        kind=str(content["kind"]),
        trials=_count(content["trials"]),
        samples=_count(content["samples"]),
        rho=_share(content["rho"]),
        limits={int(k): float(v) for k, v in dict(content["limits"]).items()},
        tables=tables,
        parameters={str(key): model["parameters"] for key, model in models.items()},
        default=default,
        parts=checked_parts(content.get("parts", {})),
    )


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


def _axis(values: Any) -> tuple[float, ...]:  # noqa: ANN401
    axis = np.array(values, dtype=np.float64)
    if axis.ndim != 1 or not 2 <= axis.size <= _MOST_POINTS:
        raise ValueError("an axis needs 2 to 400 points")
    if not bool(np.isfinite(axis).all()) or not bool((np.diff(axis) > 0).all()):
        raise ValueError("an axis does not increase")
    return tuple(axis.tolist())


def _rows(
    values: Any,  # noqa: ANN401
    shape: tuple[int, int],
    least: float,
) -> tuple[tuple[float, ...], ...]:
    table = np.array(values, dtype=np.float64)
    if table.shape != shape or not bool(np.isfinite(table).all()):
        raise ValueError(f"a table is not {shape[0]} x {shape[1]} finite numbers")
    if bool((table < least).any()):
        raise ValueError("a standard deviation is negative")
    return tuple(tuple(row) for row in table.tolist())
