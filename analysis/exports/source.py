"""What is exported: terrains of a database, by one model, with where they come from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

from acquisition.errors import SettingsError
from analysis.exports.names import identifiers, shown
from analysis.exports.profile import FrictionProfile, Spread, profile_of
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.table import Table


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What the targets are asked for.

    Attributes:
        spread: which spread of friction simulators draw.
        is_float: single precision in C.
        required: F_t [N] that a map gives the risk for,
        load: at this F_n [N].
        grid: names of terrains by row and column of a map, row 0 at the largest x;
            "" = unknown. Empty = one patch of every terrain.
        resolution: size of a cell of the map [m].
        sole_area: area of the sole [m2]; None = not known.
    """

    spread: Spread = "episode"
    is_float: bool = False
    required: float = 4.0
    load: float = 5.0
    grid: tuple[tuple[str, ...], ...] = ()
    resolution: float = 0.1
    sole_area: float | None = None


@dataclass(frozen=True, slots=True)
class ExportedTerrain:
    """One terrain as it is exported.

    Attributes:
        name: in the database; may hold anything.
        identifier: letters, digits and underscores, for names in other languages.
        known: what the database knows.
        table: of the model that is exported.
        profile: one coefficient of friction per episode.
    """

    name: str
    identifier: str
    known: KnownTerrain
    table: Table
    profile: FrictionProfile


@dataclass(frozen=True, slots=True)
class TerrainExport:
    """Everything that a target is given.

    Attributes:
        terrains: in the database's order.
        model: name of the model.
        title: of the model, for people.
        digest: SHA-256 of the database.
        made_utc: when the database was made.
        is_simulated: its trials were simulated.
        version: of Traction.
        options: what is asked for.
    """

    terrains: tuple[ExportedTerrain, ...]
    model: str
    title: str
    digest: str
    made_utc: str
    is_simulated: bool
    version: str
    options: ExportOptions = field(default_factory=ExportOptions)

    @classmethod
    def of(
        cls,
        database: TerrainDatabase,
        digest: str,
        version: str,
        names: tuple[str, ...] = (),
        model: str = "",
        options: ExportOptions | None = None,
    ) -> "TerrainExport":
        """Return the export of a database.

        Args:
            database: the terrains.
            digest: SHA-256 of its file.
            version: of Traction.
            names: of the terrains that are wanted; all where empty.
            model: name of the model; "" = the default.
            options: what is asked for.

        Raises:
            SettingsError: there is no such terrain or model, or a table has no load.
        """
        options = options or ExportOptions()
        wanted = {name: database.terrain(name) for name in names or database.terrains}
        model = model or next(iter(wanted.values())).default
        for known in wanted.values():
            if model not in known.tables:
                raise SettingsError(
                    f"{known.name!r:.60}: there is no model {model!r:.60}.",
                    hint=f"Models: {', '.join(known.tables)}. Nothing was written.",
                )
        words = identifiers(wanted)
        terrains = tuple(
            ExportedTerrain(
                name,
                words[name],
                known,
                known.tables[model],
                profile_of(
                    known, model, options.spread, is_simulated=database.is_simulated
                ),
            )
            for name, known in wanted.items()
        )
        return cls(
            terrains=terrains,
            model=model,
            title=terrains[0].known.titles.get(model, model),
            digest=digest,
            made_utc=database.made_utc,
            is_simulated=database.is_simulated,
            version=version,
            options=options,
        )

    @property
    def trials_are(self) -> str:
        """What every artefact says of the trials."""
        return "SIMULATED trials" if self.is_simulated else "recorded trials"

    @property
    def origin(self) -> str:
        """Where it comes from, in a line of plain letters."""
        return (
            f"Traction {shown(self.version)}, {self.trials_are}, model "
            f"{shown(self.title)}, database {self.digest[:16]} of "
            f"{shown(self.made_utc)}"
        )

    @property
    def made_ns(self) -> int:
        """When the database was made, UTC [ns]; 0 where it does not say."""
        try:
            made = datetime.fromisoformat(self.made_utc)
        except ValueError:
            return 0
        since = made.replace(tzinfo=made.tzinfo or UTC) - datetime(
            1970, 1, 1, tzinfo=UTC
        )
        seconds = since // timedelta(seconds=1)
        return seconds * 10**9 if 0 <= seconds < 2**31 else 0

    def source(self) -> dict[str, Any]:
        """Return the content of `source.json`."""
        return {
            "database_sha256": self.digest,
            "database_made_utc": self.made_utc,
            "model": self.model,
            "traction": self.version,
            "simulated": self.is_simulated,
            "spread": self.options.spread,
            "terrains": {
                t.name: {
                    "identifier": t.identifier,
                    "kind": t.known.kind,
                    "incline_deg": t.known.incline_deg,
                    "trials": t.known.trials,
                    "samples": t.known.samples,
                }
                for t in self.terrains
            },
        }

    def profiles(self) -> Mapping[str, Any]:
        """Return the content of `profile.json`: where it comes from, and every profile.

        Terrains are found by the name that they have in the database.
        """
        return {
            "origin": self.origin,
            "simulated": self.is_simulated,
            "terrains": {
                t.name: {"identifier": t.identifier, **t.profile.to_dict()}
                for t in self.terrains
            },
        }
