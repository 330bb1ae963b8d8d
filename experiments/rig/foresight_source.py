"""What foresight knows: the models of a terrain database, and where they come from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.errors import SettingsError
from analysis.breakaway.model import BreakAwayModel
from analysis.foresight.engine import Foresight
from analysis.foresight.model import ForesightModel, RigIdentity
from analysis.terrains.database import load
from analysis.terrains.parts import foresight_in

STUDY_DATABASE = Path("study") / "terrains.json"  # below the data: of its report


@dataclass(frozen=True, slots=True)
class ForesightSource:
    """What foresight is run with.

    Attributes:
        path: the terrain database it comes from.
        model: what was learnt.
        break_away: break-away models by terrain.
        digest: SHA-256 of model and break-away models, as text.
    """

    path: Path
    model: ForesightModel
    break_away: Mapping[str, BreakAwayModel]
    digest: str

    def started(self, rig: RigIdentity) -> Foresight:
        """Return foresight for a rig, before its first sample."""
        return Foresight(self.model, self.break_away, rig)

    def metadata(self, rig: RigIdentity) -> dict[str, str]:
        """Return what a trial says of it."""
        return {
            "sha256": self.digest,
            "terrains": json.dumps(list(self.model.terrains)),
            "known_rig": "true" if self.model.knows(rig) else "false",
        }

    def settings(self) -> dict[str, Any]:
        """Return it as plain values, for another process."""
        return _plain(self.model, self.break_away)


def _plain(
    model: ForesightModel, break_away: Mapping[str, BreakAwayModel]
) -> dict[str, Any]:
    laws = {name: one.to_dict() for name, one in break_away.items()}
    return {"model": model.to_dict(), "break_away": laws}


def read_foresight(path: Path) -> ForesightSource:
    """Return the foresight in a terrain database.

    Raises:
        SettingsError: the file cannot be read, is none, or knows no foresight.
    """
    database = load(path)
    model = foresight_in(database.parts)
    if model is None:
        raise SettingsError(
            f"{path} contains no foresight models: it was made by an earlier "
            "version, or from too few trials.",
            hint="Make it again: traction report --all. Nothing was started.",
        )
    break_away = {
        name: terrain.from_rest
        for name, terrain in database.terrains.items()
        if name in model.terrains and terrain.has_from_rest
    }
    text = json.dumps(_plain(model, break_away), sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return ForesightSource(path, model, break_away, digest)
