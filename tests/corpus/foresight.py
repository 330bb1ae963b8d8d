"""Readers of what foresight has from outside: its models, and a trial with its channel.

They raise a `TractionError` where they refuse; anything else is a failure.
"""

from functools import lru_cache
from pathlib import Path

import numpy as np

from acquisition.sample import Record
from acquisition.trial_file.reader import TrialReader
from analysis.foresight.engine import ForesightState
from experiments.rig.foresight_process import state_record, states_of
from experiments.rig.foresight_source import read_foresight
from tests.acquisition.trials import make_cycles
from tests.analysis.foresight.made import OTHER_RIG, RATE, RIG, push_on_stones

CYCLES = 1500
_SPOILT_FROM = 1000  # cycle; until then the trial is sound
_IMPOSSIBLE = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e30, -1e30, 0.0)
_ALONG = (1.0, 0.0, 0.0)


@lru_cache
def foreseen_cycles() -> Record:
    """Return the cycles of a push on stones, with impossible values at its end."""
    cycles = make_cycles(CYCLES)
    v_t, F_t, F_n = (column[:CYCLES] for column in push_on_stones(50))
    cycles["foot_position"][:] = 0.0
    cycles["foot_position"][:, 0] = np.cumsum(v_t) / RATE
    cycles["traction"][:, 1], cycles["traction"][:, 2] = F_t, F_n
    for k, value in enumerate(_IMPOSSIBLE):
        cycles["traction"][_SPOILT_FROM + 40 * k, 1 + k % 2] = value
        cycles["foot_position"][_SPOILT_FROM + 20 + 40 * k, 0] = value
    return cycles


def foresee(path: Path) -> list[ForesightState]:
    """Return what the models in a file say of a trial, on their rig and on another.

    Raises:
        AssertionError: something that is called a probability is none.
    """
    source = read_foresight(path)
    states = [
        state
        for rig in (RIG, OTHER_RIG)
        for state in states_of(source.started(rig), foreseen_cycles(), _ALONG)
    ]
    for state in states:
        shares = (state.slip_probability, state.break_away_risk, state.none)
        for share in (*shares, *state.terrains):
            assert np.isnan(share) or 0.0 <= share <= 1.0, state
        state_record(state)
    return states


def read_models(data: bytes, folder: Path) -> None:
    """Foresee a trial with what `data` teaches."""
    path = folder / "terrains.json"
    path.write_bytes(data)
    foresee(path)


def read_foreseen(data: bytes, folder: Path) -> None:
    """Read `data` as a trial that was foreseen."""
    path = folder / "T01.mcap"
    path.write_bytes(data)
    TrialReader(path).foresight()
