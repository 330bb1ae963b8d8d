"""The foresight channel of a trial, computed anew from its record and compared."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.errors import SettingsError
from acquisition.sample import Record
from acquisition.schema import FORESIGHT
from acquisition.trial_file.reader import TrialReader
from analysis.data.load import load_trial
from analysis.foresight.model import RigIdentity
from experiments.rig.foresight_process import state_record, states_of
from experiments.rig.foresight_source import ForesightSource

OPEN_END = 25  # last states that a process may not have come to at the end


@dataclass(frozen=True, slots=True)
class ForesightReplay:
    """What was foreseen while a trial was recorded, computed anew from the record.

    Attributes:
        recorded: number of states in the record.
        computed: number of states that the record gives.
        equal: number of states that are there and equal bit for bit.
        first_other: cycle of the first state that is another one, or has no other;
            None where all are equal.
        is_same_source: it was foreseen with the same models.
    """

    recorded: int
    computed: int
    equal: int
    first_other: int | None
    is_same_source: bool

    @property
    def is_proved(self) -> bool:
        """Whether every recorded state is the computed one, the last few left open."""
        is_whole = self.computed - self.recorded <= OPEN_END
        return self.first_other is None and is_whole and self.is_same_source


def replay_foresight(path: Path, source: ForesightSource) -> ForesightReplay:
    """Compute anew what was foreseen in a trial, sample by sample, and compare.

    Raises:
        TrialFileError: the file is no sound trial.
        SettingsError: nothing was foreseen in it.
    """
    trial, reader = load_trial(path), TrialReader(path)
    if not reader.has_foresight:
        raise SettingsError(
            f"{trial.name}: it has no foresight channel.",
            hint="Record with one: traction run TERRAIN --foresight FILE",
        )
    recorded = reader.foresight().data
    rig = RigIdentity.of(trial.metadata["trial"])
    along: list[float] = trial.frame.axes()[0].tolist()
    states = states_of(source.started(rig), trial.cycles, along)
    computed = np.frombuffer(b"".join(map(state_record, states)), FORESIGHT.dtype)
    return _compare(recorded, computed, reader, source)


def _compare(
    recorded: Record, computed: Record, reader: TrialReader, source: ForesightSource
) -> ForesightReplay:
    stamped = computed.copy()
    count = min(len(recorded), len(stamped))
    for name in ("sec", "nanosec"):  # set by the writer, from host_ns
        stamped[name][:count] = recorded[name][:count]
    size = FORESIGHT.size
    ours, theirs = stamped[:count].tobytes(), recorded[:count].tobytes()
    is_equal = [
        ours[i * size : (i + 1) * size] == theirs[i * size : (i + 1) * size]
        for i in range(count)
    ]
    other = is_equal.index(False) if False in is_equal else None
    first = None if other is None else int(recorded["cycle"][other])
    if first is None and len(recorded) > count:
        first = int(recorded["cycle"][count])
    digest = reader.metadata.get("foresight", {}).get("sha256", "")
    return ForesightReplay(
        recorded=len(recorded),
        computed=len(computed),
        equal=sum(is_equal),
        first_other=first,
        is_same_source=digest == source.digest,
    )
