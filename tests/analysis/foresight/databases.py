"""A terrain database with foresight, without the hours of a study."""

import numpy as np

from analysis.breakaway.censored import Family
from analysis.breakaway.model import BREAK_AWAY, BreakAwayModel, PushLaw
from analysis.terrains.database import to_text
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.parts import BREAK_AWAY_PART, FORESIGHT_PART
from analysis.terrains.table import Table
from tests.analysis.foresight.made import OTHER_RIG, PLATE, RIG, STONES, model

UTC = "2027-01-15T08:00:00Z"
BREAKS = BreakAwayModel(
    kind=BREAK_AWAY,
    family=Family.LOGNORMAL,
    law=PushLaw(2.0, 0.2, 0.3, 0.1),
    draws=np.array([[2.0, 0.2, 0.3, 0.1]]),
    v_slip=0.12,
    slips=50,
    held=5,
    trials=10,
    loads=(1.0, 8.0),
    forces=(2.0, 12.0),
)


def known(name, parts):
    """Return a terrain whose F_t is 1 N."""
    ones = np.ones((2, 2))
    table = Table.normal((0.0, 10.0), (0.005, 0.2), ones, 0.1 * ones)
    kind = "flat" if name == PLATE else "small"
    return KnownTerrain(
        *(name, kind, 5, 900, 0.0, {}, {"gp_se": table}, {"gp_se": {}}, "gp_se"),
        parts=parts,
    )


def database(foresight=None):
    """Return the text of a database; without foresight as version 2 was before it."""
    terrains = {
        STONES: known(STONES, {BREAK_AWAY_PART: BREAKS.to_dict()}),
        PLATE: known(PLATE, {}),
    }
    parts = {} if foresight is None else {FORESIGHT_PART: foresight}
    return to_text(TerrainDatabase(terrains, True, UTC, parts))


def laboratory_database():
    """Return the text of tests/data/lab/terrains.json.

    The laboratory's arm counts as a live one; and what it pushes with lies within all
    that slips were learnt from, so that every state is computed in full.
    """
    content = model().to_dict()
    content["provenance"]["rigs"] = [RIG.to_dict(), OTHER_RIG.to_dict()]
    content["slip"]["reach"] = [30.0, 60.0]
    return database(content)


def write_database(path):
    """Write a database with what made pushes teach."""
    path.write_text(database(model().to_dict()))
    return path
