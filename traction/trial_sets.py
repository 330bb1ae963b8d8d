"""An ordered set of trials: select, plot and tabulate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from acquisition.errors import SettingsError
from acquisition.wording import counted
from analysis.data.prepare import PreparedTrial
from analysis.data.terrain_kinds import terrain_kind
from experiments.export.quantities import KEPT
from experiments.export.table_columns import columns_of
from traction.frames import data_frame
from traction.trials import SERIES_UNITS, Trial

if TYPE_CHECKING:
    from analysis.report.style import Figure
    from traction.frames import DataFrame


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class TrialSet(Sequence[Trial]):
    """Trials of a session or of tables, in order.

    Attributes:
        name: name of the session, or of the files.
        trials: the trials in order.
    """

    name: str
    trials: tuple[Trial, ...]

    def __repr__(self) -> str:
        kind = ", simulated" if any(t.is_simulated for t in self.trials) else ""
        trials = counted(len(self.trials), "trial")
        return f"<{self.name}: {trials} on {', '.join(self.terrains) or '-'}{kind}>"

    def __len__(self) -> int:
        return len(self.trials)

    def __iter__(self) -> Iterator[Trial]:
        return iter(self.trials)

    @overload
    def __getitem__(self, key: int | str) -> Trial: ...

    @overload
    def __getitem__(self, key: slice) -> TrialSet: ...

    def __getitem__(self, key: int | str | slice) -> Trial | TrialSet:
        """Return a trial by its index or name, or a slice of the set.

        Raises:
            IndexError: the index is out of range.
            SettingsError: no trial, or more than one, has that name.
        """
        if isinstance(key, slice):
            return TrialSet(self.name, self.trials[key])
        if isinstance(key, int):
            return self.trials[key]
        matches = [t for t in self.trials if key in {t.name, t.name.rpartition("/")[2]}]
        if len(matches) != 1:
            names = ", ".join(trial.name for trial in self.trials[:20])
            raise SettingsError(
                f"{self.name}: {len(matches)} trials are called {key!r}.",
                hint=f"There are {names}.",
            )
        return matches[0]

    @property
    def terrains(self) -> tuple[str, ...]:
        """Names of the terrains, in the order of the trials."""
        return tuple(dict.fromkeys(trial.terrain for trial in self.trials))

    def on(self, terrain: str) -> TrialSet:
        """Return the trials on one terrain.

        Raises:
            SettingsError: there are none.
        """
        chosen = tuple(trial for trial in self.trials if trial.terrain == terrain)
        if not chosen:
            raise SettingsError(
                f"{self.name}: no trial on {terrain!r}.",
                hint=f"The terrains are {', '.join(self.terrains)}.",
            )
        return TrialSet(self.name, chosen)

    def to_pandas(self, *, kept: bool = True) -> DataFrame:
        """Return all trials as one table, with the columns "trial" and "terrain".

        >>> import traction as tr
        >>> samples = tr.load_session("S001").to_pandas()
        >>> list(samples.columns)
        ['trial', 'terrain', 't', 'v_t', 'F_n', 'F_t', 'kept_row', 'simulated']

        Args:
            kept: only the smoothed samples that models are fitted to; else t, v_t, F_n
                and F_t of every cycle.

        Raises:
            MissingLibraryError: pandas is not installed.
            SettingsError: there is no trial.
        """
        _require(self)
        tables = [_table_of(trial, kept=kept) for trial in self.trials]
        sizes = [next(iter(table.values())).size for table in tables]
        columns = {
            name: np.concatenate([t[name] for t in tables]) for name in tables[0]
        }
        labels = {
            "trial": np.repeat([trial.name for trial in self.trials], sizes),
            "terrain": np.repeat([trial.terrain for trial in self.trials], sizes),
        }
        units = SERIES_UNITS | ({"kept_row": "1", "simulated": "1"} if kept else {})
        return data_frame(labels | columns, units, name=self.name)

    def plot(self) -> Figure:
        """Return the report's figure of F_t over travel, all trials side by side.

        Raises:
            SettingsError: there is no trial.
        """
        from analysis.report.sections.beyond_paper.trials import plot_trials

        _require(self)
        kinds = {
            name: terrain_kind(name, [trial.series.stones for trial in self.on(name)])
            for name in self.terrains
        }
        return plot_trials(
            by_terrain(self),
            kinds,
            is_simulated=any(trial.is_simulated for trial in self.trials),
        )


def by_terrain(trials: Iterable[Trial]) -> dict[str, list[PreparedTrial]]:
    """Group the kept samples of trials by terrain.

    Raises:
        SettingsError: some are simulated and others are not.
    """
    trials = list(trials)
    if len({trial.is_simulated for trial in trials}) > 1:
        raise SettingsError(
            "Simulated and recorded trials cannot be mixed.",
            hint="Give trials of one kind: [t for t in trials if not t.is_simulated].",
        )
    groups: dict[str, list[PreparedTrial]] = {}
    for trial in trials:
        groups.setdefault(trial.terrain, []).append(trial.kept)
    return groups


def _table_of(trial: Trial, *, kept: bool) -> dict[str, Any]:
    if kept:
        columns = columns_of(KEPT, trial.kept, is_rounded=False)
        return {column.name: column.values for column in columns}
    return {name: getattr(trial.series, name) for name in SERIES_UNITS}


def _require(trials: TrialSet) -> None:
    if not trials.trials:
        raise SettingsError(f"{trials.name}: there is no trial.")
