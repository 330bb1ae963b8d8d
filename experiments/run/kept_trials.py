"""What a session shows of its kept trials while it runs: table and traces."""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from analysis.data.load import RecordedTrial
from experiments.operator.graphs import KeptRow, WayTrace
from experiments.session.derivation import kept_sidecars
from experiments.session.store import SessionFolder

TRACE_CELLS = 72  # shares of the way in a trace


def traces_of(trial: RecordedTrial) -> tuple[WayTrace, ...]:
    """Return the largest F_t and v_t in every share of the way, shape (72,) each."""
    share = trial.displacement / trial.frame.travel
    cells = np.floor(share * TRACE_CELLS).astype(int)
    traces: list[WayTrace] = []
    for name, unit, column in (("F_t", "N", 1), ("v_t", "m/s", 0)):
        values = np.full(TRACE_CELLS, np.nan)
        known = np.abs(trial.traction[:, column])
        is_inside = (cells >= 0) & (cells < TRACE_CELLS) & np.isfinite(known)
        np.fmax.at(values, cells[is_inside], known[is_inside])
        traces.append(WayTrace(name, unit, values))
    return tuple(traces)


def plain_trace(trace: WayTrace) -> list[float | None]:
    """Return the values of a trace for JSON, None where no sample is."""
    return [round(v, 4) if np.isfinite(v) else None for v in trace.values.tolist()]


def trace_values(value: object) -> NDArray[np.float64]:
    """Return a trace as it stands in a sidecar, empty where it is none."""
    entries = cast("list[object]", value) if isinstance(value, list) else []
    is_trace = all(x is None or type(x) in (int, float) for x in entries)
    return np.array([np.nan if x is None else x for x in entries] * is_trace, float)


def kept_rows(folder: SessionFolder) -> tuple[KeptRow, ...]:
    """Return the rows of the running table of kept trials, oldest first."""
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
    """Return the quick fits of the trials kept so far."""
    ratios = (sidecar.get("ratio") for sidecar in kept_sidecars(folder))
    return [ratio for ratio in ratios if isinstance(ratio, float)]


def kept_traces(folder: SessionFolder) -> list[dict[str, NDArray[np.float64]]]:
    """Return the traces of the trials kept so far by quantity."""
    kept = (sidecar.get("traces") for sidecar in kept_sidecars(folder))
    known = (cast("dict[str, object]", one) for one in kept if isinstance(one, dict))
    return [{name: trace_values(v) for name, v in one.items()} for one in known]
