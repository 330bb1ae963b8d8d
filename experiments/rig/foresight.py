"""Foresight beside the recorder: what it knows, and the process that runs it.

It reads the ring of samples as the recorder does, never inside the control process, and
writes what it foresees into a ring of its own, which the recorder puts into the trial.
It begins with the first cycle of a trial, so that the record alone gives the same bits.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any, Final

import numpy as np

from acquisition.control_loop.realtime import RealtimeRequest, request
from acquisition.errors import SettingsError
from acquisition.ipc.child import ChildContext, name_process
from acquisition.ipc.layout import SharedLayout
from acquisition.sample import Record
from acquisition.schema import FORESIGHT, MOST_TERRAINS
from analysis.breakaway.model import BreakAwayModel
from analysis.foresight.engine import Foresight, ForesightFlag, ForesightState
from analysis.foresight.model import ForesightModel, RigIdentity
from analysis.foresight.whole_record import FootRecord
from analysis.terrains.database import load
from analysis.terrains.parts import foresight_in
from experiments.operator.screens import OTHER_RIG_TEXT, ForesightView

NICE = 10
STUDY_DATABASE = Path("study") / "terrains.json"  # below the data: of its report
PERIOD_S = 0.01  # s between two looks at the ring
_LATE_CYCLES = 100  # 0.2 s
# host_ns to the last terrain as they lie in the message; numpy takes five times as long
_NUMBERS: Final = struct.Struct(f"<Q3I4x7d{MOST_TERRAINS}d")
_NUMBERS_AT: Final = FORESIGHT.size - _NUMBERS.size
_NOT_KNOWN: Final = (nan,) * MOST_TERRAINS


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


class ForesightWorker:
    """Foresees what the ring of samples gets, while a trial is recorded."""

    def __init__(
        self, shared: SharedLayout, foresight: Foresight, along: Sequence[float]
    ) -> None:
        """Begin at rest.

        Args:
            shared: rings of samples and of what is foreseen.
            foresight: takes the samples.
            along: x_T in the base frame, three numbers.
        """
        self._shared = shared
        self._foresight = foresight
        self._along = tuple(along)
        self._cycles = shared.cycles.reader()
        self._version = shared.trial_start.version
        self._is_running = False

    def step(self) -> None:
        """Foresee every sample that is new; begin anew where a trial does."""
        self._follow_trial()
        if not self._is_running:
            return
        while self._cycles.backlog:
            records = self._cycles.read()
            for state in states_of(self._foresight, records, self._along):
                self._shared.foresight.write(state_record(state))

    def _follow_trial(self) -> None:
        version = self._shared.trial_start.version
        if version == self._version:
            return
        text = self._shared.trial_start.read()
        self._version = version
        self._is_running = bool(text)
        if self._is_running:
            self._foresight.reset()
            self._cycles.seek(int(text))


def foresight_view(
    records: Record, terrains: Sequence[str], newest_cycle: int
) -> ForesightView:
    """Return what is foreseen, for the screen.

    Args:
        records: of traction_msgs/Foresight, of the last seconds, oldest first.
        terrains: names of the known terrains.
        newest_cycle: of the loop; a state that is 0.2 s older is late.
    """
    if not len(records):
        return ForesightView(np.zeros(0), np.nan, np.nan, {}, np.nan, is_late=True)
    newest = records[-1]
    flags = int(newest["flags"])
    shares = newest["terrains"][: len(terrains)].tolist()
    states = (
        (ForesightFlag.OTHER_RIG, True, OTHER_RIG_TEXT),
        (ForesightFlag.SLIPPING, True, "slipping"),
        (ForesightFlag.CONTACT, False, "no contact"),
    )
    words = (text for flag, is_set, text in states if bool(flags & flag) is is_set)
    is_ground = bool(flags & ForesightFlag.GROUND)
    return ForesightView(
        slip_probability=np.array(records["slip_probability"]),
        break_away_risk=float(newest["break_away_risk"]),
        traction=float(newest["traction"]),
        terrains=dict(zip(terrains, shares, strict=True)) if is_ground else {},
        none=float(newest["none"]),
        state=next(words, ""),
        is_late=newest_cycle - int(newest["cycle"]) > _LATE_CYCLES,
    )


def states_of(
    foresight: Foresight, cycles: Record, along: Sequence[float]
) -> list[ForesightState]:
    """Return what is foreseen from cycles, one after the other."""
    states = map(foresight.push, FootRecord.of(cycles, along).samples)
    return [state for state in states if state is not None]


def state_record(state: ForesightState) -> bytes:
    """Return a state as a record of traction_msgs/Foresight, its stamp not yet set."""
    record = bytearray(FORESIGHT.template)
    _NUMBERS.pack_into(
        record,
        _NUMBERS_AT,
        *(state.host_ns, state.cycle, state.since, state.flags),
        *(state.slip_probability, state.break_away_risk, state.traction),
        *(state.v_t, state.F_t, state.F_n, state.none),
        *state.terrains,
        *_NOT_KNOWN[len(state.terrains) :],
    )
    return bytes(record)


def main(context: ChildContext) -> None:
    """Foresee until the console hangs up."""
    name_process("traction-sight")
    settings = context.settings
    request(RealtimeRequest(nice=NICE, core=settings.get("core")))
    break_away = {
        str(name): BreakAwayModel.from_dict(one)
        for name, one in dict(settings["break_away"]).items()
    }
    rig = RigIdentity.of(settings["rig"])
    model = ForesightModel.from_dict(settings["model"])
    worker = ForesightWorker(
        context.shared, Foresight(model, break_away, rig), settings["along"]
    )
    while not context.channel.is_readable(PERIOD_S):  # it is when the console hangs up
        worker.step()
