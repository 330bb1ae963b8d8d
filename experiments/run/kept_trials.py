"""Table and traces of the kept trials, for a running session."""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from analysis.data.load import RecordedTrial
from experiments.operator.graphs import KeptRow, TravelTrace
from experiments.session.derivation import kept_sidecars
from experiments.session.store import SessionFolder

TRACE_CELLS = 72  # sections of the travel in a trace


def traces_of(trial: RecordedTrial) -> tuple[TravelTrace, ...]:
    """Largest |F_t| and |v_t| in every section of the travel, shape (72,) each."""
    share = trial.displacement / trial.frame.travel
    cells = np.floor(share * TRACE_CELLS).astype(int)
    traces: list[TravelTrace] = []
    for name, unit, column in (("F_t", "N", 1), ("v_t", "m/s", 0)):
        values = np.full(TRACE_CELLS, np.nan)
        values_abs = np.abs(trial.traction[:, column])
        is_inside = (cells >= 0) & (cells < TRACE_CELLS) & np.isfinite(values_abs)
        np.fmax.at(values, cells[is_inside], values_abs[is_inside])
        traces.append(TravelTrace(name, unit, values))
    return tuple(traces)


def trace_to_json(trace: TravelTrace) -> list[float | None]:
    """Return the values of a trace for JSON, None without a sample."""
    return [round(v, 4) if np.isfinite(v) else None for v in trace.values.tolist()]


def trace_values(value: object) -> NDArray[np.float64]:
    """Parse a trace of a sidecar, shape (n,); empty if it is malformed."""
    entries = cast("list[object]", value) if isinstance(value, list) else []
    is_trace = all(x is None or type(x) in (int, float) for x in entries)
    return np.array([np.nan if x is None else x for x in entries] * is_trace, float)


def kept_rows(folder: SessionFolder) -> tuple[KeptRow, ...]:
    """Rows of the table of kept trials, oldest first."""
    return tuple(_kept_row(sidecar) for sidecar in kept_sidecars(folder))


def _kept_row(sidecar: Mapping[str, Any]) -> KeptRow:
    slips, notes = sidecar.get("slips"), sidecar.get("notes")
    newest = cast("list[object]", notes)[-1:] if isinstance(notes, list) else []
    remark = "".join(
        str(cast("dict[str, object]", note).get("text", ""))
        for note in newest
        if isinstance(note, dict)
    )
    return KeptRow(
        trial=str(sidecar.get("trial", "?")),
        v_t=_number_or_none(sidecar.get("v_t")),
        ratio=_number_or_none(sidecar.get("ratio")),
        slips=slips if type(slips) is int else None,
        remark=remark,
    )


def _number_or_none(value: object) -> float | None:
    return float(value) if isinstance(value, float | int) else None


def kept_ratios(folder: SessionFolder) -> list[float]:
    """Quick fits F_t/F_n of the trials kept so far."""
    ratios = (sidecar.get("ratio") for sidecar in kept_sidecars(folder))
    return [ratio for ratio in ratios if isinstance(ratio, float)]


def kept_traces(folder: SessionFolder) -> list[dict[str, NDArray[np.float64]]]:
    """Traces of the trials kept so far, by quantity."""
    kept = (sidecar.get("traces") for sidecar in kept_sidecars(folder))
    entries = (cast("dict[str, object]", e) for e in kept if isinstance(e, dict))
    return [{name: trace_values(v) for name, v in e.items()} for e in entries]
