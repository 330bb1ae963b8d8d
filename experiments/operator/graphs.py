"""Bars and tables made of characters, fitted to a terminal; pure functions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_BARS = "▁▂▃▄▅▆▇█"
_ABSURD = 1e9  # limit of plausible values
# Largest forces that a push needs [N]; the permitted ones are in LimitSection.
PUSH_ALONG, PUSH_ACROSS = 60.0, 30.0
_JOINT = "\u00a0"  # no-break space


@dataclass(frozen=True, slots=True)
class BarScale:
    """Scale of the bars, the same for all trials.

    Attributes:
        limit: limit of the guard; the highest bar.
        lowest, highest: desired band of a push.
        unit: unit of all values.
        form: format of a number.
    """

    limit: float
    lowest: float
    highest: float
    unit: str
    form: str

    def heights(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights 0..1 for magnitudes from 0 to the limit, same shape.

        The square root keeps a push at a tenth of the limit visible.
        """
        return np.sqrt(np.clip(np.abs(values) / self.limit, 0.0, 1.0))

    def number(self, value: float) -> str:
        """Return a value with its unit."""
        text = f"{value:{self.form}}"
        return f"{text.removeprefix('-') if float(text) == 0.0 else text} {self.unit}"

    def band_words(self, value: float) -> str:
        """Return the band as text, with the side of it on which `value` is."""
        band = f"{self.lowest:g}..{self.highest:g}"
        if not np.isfinite(value):
            return f"▲ unknown, band {band}"
        if value > self.highest:
            return f"▲ above {band}"
        return f"{'below' if value < self.lowest else 'in'} {band}"


@dataclass(frozen=True, slots=True)
class LiveScales:
    """The scales of a running trial's bars, from the limits of rig.toml.

    Attributes:
        used_speeds: velocity range of the samples that models use [m/s].
        foot_speed: limit beyond which the arm damps [m/s].
        contact_force: limit beyond which the trial ends [N].
    """

    used_speeds: tuple[float, float]
    foot_speed: float = 0.8
    contact_force: float = 100.0

    @property
    def v_t(self) -> BarScale:
        """Scale of velocity; its band is that of the samples that models use."""
        return BarScale(self.foot_speed, *self.used_speeds, "m/s", ".3f")

    @property
    def F_t(self) -> BarScale:
        """Scale of traction."""
        return BarScale(self.contact_force, 0.0, PUSH_ALONG, "N", ".1f")

    @property
    def F_n(self) -> BarScale:
        """Scale of normal force."""
        return BarScale(self.contact_force, 0.0, PUSH_ACROSS, "N", ".1f")


def sparkline(
    values: Sequence[float] | NDArray[np.float64], width: int, scale: BarScale
) -> str:
    """Return `values` as `width` bars; the last bar is the newest value.

    Each bar before it is the largest magnitude of its section, so that a short slip
    shows. NaN leaves its bar empty.
    """
    data = np.asarray(values, dtype=np.float64)
    if not len(data) or width < 1:
        return " " * max(0, width)
    parts = np.array_split(data[:-1], width - 1) if width > 1 else []
    peaks = [_peak(part) for part in parts if len(part)]
    return bars(scale.heights(np.array([*peaks, _peak(data[-1:])]))).rjust(width)


def _peak(part: NDArray[np.float64]) -> float:
    """Largest plausible magnitude, NaN if there is none."""
    plausible = np.abs(part)[np.abs(part) < _ABSURD]  # drops NaN
    return float(plausible.max()) if len(plausible) else np.nan


def bars(heights: NDArray[np.float64]) -> str:
    """Return one bar for each height of 0..1, a space for NaN."""
    top = len(_BARS) - 1
    return "".join(
        _BARS[round(min(max(height, 0.0), 1.0) * top)] if np.isfinite(height) else " "
        for height in heights.tolist()
    )


@dataclass(frozen=True, slots=True)
class TravelTrace:
    """A quantity over the travel along the container.

    Attributes:
        name: name of the quantity.
        unit: unit of the values.
        values: largest magnitude in each section of the travel, NaN without a sample.
    """

    name: str
    unit: str
    values: NDArray[np.float64]


def trace_lines(
    trace: TravelTrace, kept: Sequence[NDArray[np.float64]], name: str, width: int
) -> list[str]:
    """Return a trace in `width` columns, with the median of the kept ones.

    Args:
        trace: trace of this trial.
        kept: values of the kept trials, in the same sections of the travel.
        name: name of this trial.
        width: width of the terminal [characters].
    """
    label = max(len(name), len("kept"))
    columns = max(1, width - label - 2)
    rows = [_resampled(trace.values, columns)]
    same = [values for values in kept if values.shape == trace.values.shape]
    if same:
        rows.append(_resampled(_median(np.stack(same)), columns))
    values = np.concatenate(rows)
    top = float(np.nanmax(values)) if np.isfinite(values).any() else 0.0
    if top <= 0.0:
        return []
    number = f"{top:.3f}" if top < 1.0 else f"{top:.1f}"
    words = f"{trace.name} over displacement, full bar {number} {trace.unit}"
    if same:
        words += f"; kept: median of {len(same)}"
    names = [name, "kept"]
    return [words[:width]] + [
        f" {title:<{label}} {bars(row / top)}"
        for title, row in zip(names, rows, strict=False)
    ]


def _median(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Median of every column without its NaN; NaN for an empty one."""
    columns = [column[np.isfinite(column)] for column in rows.T]
    return np.array([np.median(c) if len(c) else np.nan for c in columns])


def _resampled(values: NDArray[np.float64], columns: int) -> NDArray[np.float64]:
    """Return the largest value of each of `columns` sections; never more than given."""
    if columns >= len(values):
        return values
    return np.array([_peak(part) for part in np.array_split(values, columns)])


@dataclass(frozen=True, slots=True)
class KeptRow:
    """A kept trial in the running table; None = unknown.

    Attributes:
        trial: name of the trial.
        v_t: median velocity while moving [m/s].
        ratio: slope of F_t over F_n.
        slips: number of slips.
        remark: newest note on it; empty for none.
    """

    trial: str
    v_t: float | None
    ratio: float | None
    slips: int | None
    remark: str


def kept_table(rows: Sequence[KeptRow], width: int, most: int) -> list[str]:
    """Return the newest `most` rows as lines of at most `width` characters."""
    if not rows:
        return []
    earlier = len(rows) - most
    more = f"  ({earlier} earlier)" if earlier > 0 else ""
    lines = [f"kept    v_t [m/s]  F_t/F_n  slips  remark{more}"]
    for row in rows[-most:]:
        v_t = "?" if row.v_t is None else f"{row.v_t:.3f}"
        ratio = "?" if row.ratio is None else f"{row.ratio:.2f}"
        slips = "?" if row.slips is None else str(row.slips)
        start = f"{row.trial:<5}  {v_t:>9}  {ratio:>7}  {slips:>5}  "
        lines.append(start + _shortened(row.remark, width - len(start)))
    return [line.rstrip() for line in lines]


def _shortened(text: str, most: int) -> str:
    return text if len(text) <= most else text[: max(0, most - 1)] + "…"


def packed(text: str, width: int) -> str:
    """Wrap `text` at `width`, between its parts if possible.

    Parts are separated by two spaces or " · ", as keys are: "[space] record" is one
    part. A part longer than a line is broken between words.
    """
    import textwrap

    parts = [
        part.replace(" ", _JOINT) if len(part) <= width else part
        for part in _parts(text)
    ]
    lines = textwrap.wrap(
        "  ".join(parts), width, break_long_words=False, break_on_hyphens=False
    )
    return "\n".join(line.replace(_JOINT, " ") for line in lines)


def _parts(text: str) -> list[str]:
    spaced = text.replace(" · ", "  · ")
    return [part.strip() for part in spaced.split("  ") if part.strip()]


def fitted(lines: Sequence[str], width: int, height: int) -> list[str]:
    """Fit the lines of a panel into a terminal of `width` x `height` characters.

    Lines are wrapped between their parts, never cut. Without room for all, lines in
    the middle are dropped: the first shows the state of the arm, the last two the
    keys.
    """
    broken = [
        packed(line, width).split("\n") if len(line) > width else [line]
        for line in lines
    ]
    head, foot = broken[:1], broken[-2:] if len(broken) > 2 else broken[1:]
    middle = [line for group in broken[1:-2] for line in group]
    outer = sum(map(len, head)) + sum(map(len, foot))
    room = max(0, height - outer)
    middle = (
        middle if len(middle) <= room else [*middle[: max(0, room - 1)], "…"][:room]
    )
    return [*(x for g in head for x in g), *middle, *(x for g in foot for x in g)]
