"""Ground truth of the simulation and its record layout."""

from collections.abc import Sequence

import numpy as np

from acquisition.sample import Record
from acquisition.schema import TRUTH
from ft_sensor.payload import TerrainFrame
from wam.model.constants import Array

MOST_ROWS = 60_000  # two minutes; a trial takes 30 s at most


class Truth:
    """Ground truth, one row per cycle; terrain frame unless stated.

    Columns: q [rad] 0-6, sole position [m] 7-9, sole velocity [m/s] 10-12, ground's
    force on the foot along -x, y, z [N] 13-15, hand's force [N] 16-18.
    """

    COLUMNS = 19

    def __init__(self) -> None:
        self.t_ns: list[int] = []
        self._taken = 0
        self._values: list[float] = []

    def add(self, t_ns: int, values: Sequence[float]) -> None:
        """Append one row, up to `MOST_ROWS`."""
        if len(self.t_ns) >= MOST_ROWS:
            return
        self.t_ns.append(t_ns)
        self._values.extend(values)

    def take(self, rows: int) -> "Truth":
        """Return the oldest rows not yet taken, `rows` at most.

        They stay in memory, because removing rows at the front would move all others
        and delay the bus.
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
    """Convert `truth` to traction_msgs/Truth records, base frame."""
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
    records["sole_position"] = rows[:, 7:10] @ axes + np.array(frame.start)
    records["contact_force"] = (force * [-1.0, 1.0, 1.0]) @ axes
    records["hand_force"] = hand @ axes
    records["traction"] = np.column_stack([velocity[:, 0], force[:, 0], force[:, 2]])
    return records
