"""The process that runs foresight beside the recorder.

It reads the samples as the recorder does, never inside the control process, and writes
what it foresees into a ring buffer of its own, which the recorder puts into the trial.
It begins with the first cycle of a trial, so that the record alone gives the same bits.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from math import nan
from typing import Final

from acquisition.control_loop.realtime import RealtimeRequest, request
from acquisition.ipc.child import ChildContext, name_process
from acquisition.ipc.layout import SharedLayout
from acquisition.sample import Record
from acquisition.schema import FORESIGHT, MOST_TERRAINS
from analysis.breakaway.model import BreakAwayModel
from analysis.foresight.engine import Foresight, ForesightState
from analysis.foresight.foot_record import FootRecord
from analysis.foresight.model import ForesightModel, RigIdentity

NICE = 10
PERIOD_S = 0.01  # s between two looks at the samples
# host_ns to the last terrain as they lie in the message; numpy takes five times as long
_NUMBERS: Final = struct.Struct(f"<Q3I4x7d{MOST_TERRAINS}d")
_NUMBERS_AT: Final = FORESIGHT.size - _NUMBERS.size
_NOT_KNOWN: Final = (nan,) * MOST_TERRAINS


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


class ForesightWorker:
    """Foresees what the buffer of samples gets, while a trial is recorded."""

    def __init__(
        self, shared: SharedLayout, foresight: Foresight, along: Sequence[float]
    ) -> None:
        """Begin at rest.

        Args:
            shared: buffers of samples and of what is foreseen.
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
        state.host_ns,
        state.cycle,
        state.since,
        state.flags,
        state.slip_probability,
        state.break_away_risk,
        state.traction,
        state.v_t,
        state.F_t,
        state.F_n,
        state.none,
        *state.terrains,
        *_NOT_KNOWN[len(state.terrains) :],
    )
    return bytes(record)
