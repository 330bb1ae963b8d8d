"""The foot over a whole record: its samples, and what the filters say every 10 ms.

The filters are those that run in the loop (`signals`), sample by sample, so that what
is learnt from records holds for what is seen live.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from acquisition.sample import Record
from analysis.data.series import Array, Indices
from analysis.foresight.signals import EVERY, FEATURES, FootSample, Signals


@dataclass(frozen=True, slots=True, eq=False)
class FootRecord:
    """The cycles of a record as foresight reads them, shape (n,) each.

    Attributes:
        cycle: number.
        host_ns: time [ns].
        x: way of the sole along x_T [m].
        F_t: traction [N].
        F_n: normal force [N].
    """

    cycle: Indices
    host_ns: Indices
    x: Array
    F_t: Array
    F_n: Array

    @classmethod
    def of(cls, cycles: Record, along: Sequence[float]) -> "FootRecord":
        """Return cycles of a loop with the ways of the sole along x_T.

        Args:
            cycles: records of traction_msgs/Cycle, shape (n,).
            along: x_T in the base frame, three numbers.
        """
        sole, forces = cycles["foot_position"], cycles["traction"]
        way = along[0] * sole[:, 0] + along[1] * sole[:, 1]  # in a fixed order
        return cls(
            cycle=cycles["cycle"].astype(np.intp),
            host_ns=cycles["host_ns"].astype(np.intp),
            x=way + along[2] * sole[:, 2],
            F_t=np.ascontiguousarray(forces[:, 1]),
            F_n=np.ascontiguousarray(forces[:, 2]),
        )

    @property
    def samples(self) -> Iterator[FootSample]:
        """The cycles one by one."""
        columns = (self.cycle, self.host_ns, self.x, self.F_t, self.F_n)
        return map(FootSample, *(column.tolist() for column in columns))


@dataclass(frozen=True, slots=True, eq=False)
class RecordTicks:
    """What a record shows every 10 ms while the filters are warm.

    Attributes:
        tick: number, shape (n,).
        host_ns: time [ns], shape (n,).
        features: of `signals`, shape (n, 23).
        motion: v_t [m/s], F_t [N], F_n [N], shape (n, 3).
    """

    tick: Indices
    host_ns: Indices
    features: Array
    motion: Array


def ticks_of_record(record: FootRecord) -> RecordTicks:
    """Return the ticks of a record; a missing cycle restarts the filters."""
    rows: list[int] = []
    features: list[list[float]] = []
    motion: list[tuple[float, float, float]] = []
    signals, last = None, 0
    for row, sample in enumerate(record.samples):
        x, F_t, F_n = sample.x, sample.F_t, sample.F_n
        if not (isfinite(x) and isfinite(F_t) and isfinite(F_n)):
            continue
        if signals is not None and sample.cycle == last + 1:
            signals.push(x, F_t, F_n)
        else:
            signals = Signals(x, F_t, F_n)
        last = sample.cycle
        if signals.is_warm and last % EVERY == 0:
            rows.append(row)
            features.append(signals.features())
            motion.append((signals.v_t, signals.F_t, signals.F_n))
    at = np.array(rows, dtype=np.intp)
    return RecordTicks(
        tick=record.cycle[at] // EVERY,
        host_ns=record.host_ns[at],
        features=np.array(features, dtype=np.float64).reshape(-1, len(FEATURES)),
        motion=np.array(motion, dtype=np.float64).reshape(-1, 3),
    )
