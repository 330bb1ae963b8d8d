"""Data to export: terrains of a database with one model, and their origin."""

from dataclasses import dataclass
from typing import Any

from acquisition.errors import SettingsError
from analysis.terrains.export.names import identifiers, shown
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.table import Table


@dataclass(frozen=True, slots=True)
class ExportedTerrain:
    """One terrain to export.

    Attributes:
        name: name in the database; any text.
        identifier: letters, digits and underscores, for names in other languages.
        known: entry of the database.
        table: table of the exported model.
    """

    name: str
    identifier: str
    known: KnownTerrain
    table: Table


@dataclass(frozen=True, slots=True)
class TerrainExport:
    """Input of an export target.

    Attributes:
        terrains: terrains in the order of the database.
        model: name of the model.
        title: title of the model.
        digest: SHA-256 of the database.
        made_utc: time at which the database was made.
        is_simulated: the trials were simulated.
        version: version of Traction.
        is_float: single precision in C.
    """

    terrains: tuple[ExportedTerrain, ...]
    model: str
    title: str
    digest: str
    made_utc: str
    is_simulated: bool
    version: str
    is_float: bool = False

    @classmethod
    def of(
        cls,
        database: TerrainDatabase,
        digest: str,
        version: str,
        names: tuple[str, ...] = (),
        model: str = "",
        *,
        is_float: bool = False,
    ) -> "TerrainExport":
        """Select terrains and model of a database.

        Args:
            database: the terrains.
            digest: SHA-256 of the database file.
            version: version of Traction.
            names: names of the terrains; empty = all.
            model: name of the model; "" = the default.
            is_float: single precision in C.

        Raises:
            SettingsError: there is no such terrain or model.
        """
        chosen = {name: database.terrain(name) for name in names or database.terrains}
        model = model or next(iter(chosen.values())).default
        for known in chosen.values():
            if model not in known.tables:
                raise SettingsError(
                    f"{known.name!r:.60}: there is no model {model!r:.60}.",
                    hint=f"Models: {', '.join(known.tables)}. Nothing was written.",
                )
        words = identifiers(chosen)
        terrains = tuple(
            ExportedTerrain(name, words[name], known, known.tables[model])
            for name, known in chosen.items()
        )
        return cls(
            terrains=terrains,
            model=model,
            title=terrains[0].known.titles.get(model, model),
            digest=digest,
            made_utc=database.made_utc,
            is_simulated=database.is_simulated,
            version=version,
            is_float=is_float,
        )

    @property
    def trials_are(self) -> str:
        """Kind of the trials, as stated in every artefact."""
        return "SIMULATED trials" if self.is_simulated else "recorded trials"

    @property
    def origin(self) -> str:
        """Origin of the data in one line of plain characters."""
        return (
            f"Traction {shown(self.version)}, {self.trials_are}, model "
            f"{shown(self.title)}, database {self.digest[:16]} of "
            f"{shown(self.made_utc)}"
        )

    def source(self) -> dict[str, Any]:
        """Return the content of `source.json`."""
        return {
            "database_sha256": self.digest,
            "database_made_utc": self.made_utc,
            "model": self.model,
            "traction": self.version,
            "simulated": self.is_simulated,
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
