"""One trial for interactive use: inspect, plot and tabulate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from analysis.data.load import RecordedTrial
from analysis.data.prepare import PreparedTrial, PrepareOptions, prepare_trial
from analysis.data.series import Array, TractionSeries
from experiments.export.quantities import KEPT, QUANTITIES
from experiments.export.table_columns import TableColumn, columns_of
from traction.frames import data_frame

if TYPE_CHECKING:
    from analysis.report.style import Figure
    from traction.frames import DataFrame

SERIES_UNITS = {"t": "s", "v_t": "m/s", "F_n": "N", "F_t": "N"}


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Trial:
    """One push of the foot across a container.

    Attributes:
        series: v_t, F_n and F_t at the recorded rate.
        kept: the samples that models are fitted to: smoothed, thinned and inside the
            velocity window.
        recorded: recorded joints, wrench and sole; None for a table.
    """

    series: TractionSeries
    kept: PreparedTrial
    recorded: RecordedTrial | None = None

    def __repr__(self) -> str:
        kind = ", simulated" if self.is_simulated else ""
        notes = f" [{'; '.join(self.notes)}]" if self.notes else ""
        return (
            f"<Trial {self.name} on {self.terrain}: {self.duration:.1f} s, "
            f"{self.t.size} samples at {self.series.rate:.0f} Hz, "
            f"{self.kept.kept} kept{kind}{notes}>"
        )

    @property
    def name(self) -> str:
        """Session and trial, e.g. S012/T04, or the file of a table."""
        return self.series.name

    @property
    def notes(self) -> tuple[str, ...]:
        """Decisions made while the table was read: dropped rows, gaps, spikes."""
        return self.series.notes

    @property
    def terrain(self) -> str:
        """Name of the terrain."""
        return self.series.terrain

    @property
    def is_simulated(self) -> bool:
        """Whether the devices were simulated."""
        return self.series.is_simulated

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def t(self) -> Array:
        """Time since the first cycle [s], shape (n,)."""
        return self.series.t

    @property
    def v_t(self) -> Array:
        """Slip velocity [m/s], > 0 in ordinary slip, shape (n,)."""
        return self.series.v_t

    @property
    def F_n(self) -> Array:
        """Normal force [N], > 0 in compression, shape (n,)."""
        return self.series.F_n

    @property
    def F_t(self) -> Array:
        """Traction force [N], > 0 against ordinary slip, shape (n,)."""
        return self.series.F_t

    def to_pandas(self, *, kept: bool = False) -> DataFrame:
        """Return the trial as a table; the columns are those of `traction export`.

        >>> import traction as tr
        >>> frame = tr.load_session("S001")["T01"].to_pandas()
        >>> frame.attrs["units"]["v_t"], frame.attrs["units"]["tau7"]
        ('m/s', 'N m')

        Args:
            kept: only the smoothed samples that models are fitted to.

        Returns:
            One row per sample. `attrs` holds "units" and "meanings" by column, "trial",
            "terrain" and "simulated".

        Raises:
            MissingLibraryError: pandas is not installed.
        """
        columns = self._columns(kept=kept)
        return data_frame(
            {column.name: column.values for column in columns},
            {column.name: column.unit for column in columns},
            meanings={column.name: column.meaning for column in columns},
            trial=self.name,
            terrain=self.terrain,
            simulated=self.is_simulated,
        )

    def plot(self) -> Figure:
        """Return the report's Fig. 4: F_t and v_t over time, slips marked.

        A notebook shows the figure; `figure.savefig("T01.pdf")` saves it.
        """
        from analysis.report.sections.paper import excerpts

        return excerpts.plot_trial(self.kept, is_simulated=self.is_simulated)

    def _columns(self, *, kept: bool) -> list[TableColumn]:
        if kept:
            return columns_of(KEPT, self.kept, is_rounded=False)
        if self.recorded is not None:
            return columns_of(QUANTITIES, self.recorded, is_rounded=False)
        return [
            TableColumn(name, unit, "number", "", 0, getattr(self.series, name))
            for name, unit in SERIES_UNITS.items()
        ]


def trial_of(source: RecordedTrial | TractionSeries) -> Trial:
    """Return a recording or a series as a trial, prepared with the default options."""
    if isinstance(source, TractionSeries):
        return Trial(source, prepare_trial(source, PrepareOptions()))
    options = PrepareOptions(container_travel=source.frame.travel)
    series = source.series()
    return Trial(series, prepare_trial(series, options), source)
