"""What really happened in the simulation, and how it is written down."""

from collections.abc import Sequence

import numpy as np

from acquisition.sample import Record
from acquisition.schema import TRUTH
from ft_sensor.payload import TerrainFrame
from wam.model.constants import Array

MOST_ROWS = 60_000  # two minutes; a trial lasts half of one at most


class Truth:
    """What really happened, one row per cycle; terrain frame unless stated.

    Columns: q [rad] 0-6, sole [m] 7-9, its velocity [m/s] 10-12, ground's force on the
    foot against x, along y, along z [N] 13-15, hand's force [N] 16-18.
    """

    COLUMNS = 19

    def __init__(self) -> None:
        self.t_ns: list[int] = []
        self._taken = 0
        self._values: list[float] = []

    def add(self, t_ns: int, values: Sequence[float]) -> None:
        """Append one row; a record without a reader stays bounded."""
        if len(self.t_ns) >= MOST_ROWS:
            return
        self.t_ns.append(t_ns)
        self._values.extend(values)

    def take(self, rows: int) -> "Truth":
        """Return the oldest rows that were not taken yet, `rows` at most.

        They stay in memory until the next truth begins: to move all others down for
        every few rows would keep the bus waiting.
        """
        taken = Truth()
        start, stop = self._taken, self._taken + rows
        taken.t_ns = self.t_ns[start:stop]
        taken._values = self._values[start * self.COLUMNS : stop * self.COLUMNS]
        self._taken += len(taken.t_ns)
        return taken

    def table(self) -> Array:
        """Return all rows, shape (n, 19)."""
        return np.array(self._values).reshape(-1, self.COLUMNS)


def truth_records(truth: Truth, frame: TerrainFrame) -> Record:
    """Return `truth` in the layout of traction_msgs/Truth, base frame."""
    count = len(truth.t_ns)
    buffer = bytearray(TRUTH.template * count)
    records: Record = np.frombuffer(buffer, TRUTH.dtype)
    if not count:
        return records
    axes = frame.axes()
    rows = truth.table()
    velocity, force, hand = rows[:, 10:13], rows[:, 13:16], rows[:, 16:19]
    records["host_ns"] = truth.t_ns
    records["position"] = rows[:, :7]
    records["sole_position"] = rows[:, 7:10] @ axes + np.array(frame.far_end)
    records["contact_force"] = (force * [-1.0, 1.0, 1.0]) @ axes
    records["hand_force"] = hand @ axes
    records["traction"] = np.column_stack([velocity[:, 0], force[:, 0], force[:, 2]])
    return records
