"""Numbers of text tables: decimal marks, units, times, spikes, signs, rates."""

import numpy as np

from tests.borders.row import Border
from tests.borders.tables import (
    COUNT,
    NAMES,
    ROWS,
    VALUES,
    flagged,
    refused,
    table,
    text,
    values,
    with_cell,
    with_column,
)

_SEMI = text(delimiter=";", mark=",")
_THOUSANDS = [
    [r[0].replace(".", ","), r[1].replace(".", ","), r[2], r[3].replace(".", ",")]
    for r in ROWS
]
_GERMAN = "\n".join(
    [";".join(("t", "v_t", "F_n [mN]", "F_t")), *(";".join(r) for r in _THOUSANDS)]
)
_QUOTED = text(
    with_column(2, lambda k, old: '"' + old.replace(".", ",") + '"'),
    names=("t", "v_t", "F_n [mN]", "F_t"),
)
_T = VALUES[:, 0]


def _names(**units: str) -> list[str]:
    return [f"{n} [{units[n]}]" if n in units else n for n in NAMES]


def _scaled(column: int, factor: float) -> list[list[str]]:
    return with_column(column, lambda k, old: repr(float(old) * factor))


def _times(start: int, per_second: int) -> list[list[str]]:
    return with_column(
        0, lambda k, _: str(start * per_second + 2 * k * per_second // 1000)
    )


def _iso(zone: str, sign: str = "T") -> list[list[str]]:
    return with_column(0, lambda k, _: f"2026-11-26{sign}10:00:00.{2 * k:03d}{zone}")


def _gap(seconds: float) -> tuple[list[list[str]], np.ndarray]:
    late = with_column(
        0, lambda k, old: f"{float(old) + (seconds if k > 29 else 0):.4f}"
    )
    return late, values(t=np.array([float(row[0]) for row in late]))


def _pushed(
    v: float = 1.0, F_n: float = 1.0, F_t: float = 1.0
) -> tuple[str, np.ndarray]:
    """A table of a sliding foot, scaled by factors, and its numbers."""
    k = np.arange(200)
    rows = np.column_stack(
        [
            0.002 * k,
            (0.08 + 0.001 * (k % 7)) * v,
            (5.0 + 0.1 * (k % 5)) * F_n,
            (3.5 + 0.1 * (k % 3)) * F_t,
        ]
    )
    cells = [[f"{x:.6f}" for x in row] for row in rows]
    return text(cells), np.array(cells, dtype=np.float64)


_HOUR, _DECADE = _gap(3600.0), _gap(3.15e8)
_SLOW = with_column(0, lambda k, _: f"{0.05 * k:.2f}")
_HALF = with_column(0, lambda k, _: f"{0.004 * k:.3f}")
_SPIKED = VALUES.copy()
_SPIKED[30, 3] = 1e6
_SENTINELS = VALUES.copy()
_SENTINELS[20:22, 2] = 9999

NUMBERS: tuple[Border, ...] = (
    refused(
        "points as thousands separators, with decimal commas",
        _GERMAN,
        "line 2, column F_n: '22.051' stands where a number with decimal mark ','",
        separator=";",
        decimal=",",
    ),
    refused(
        "quoted 22,051 next to 0.0799",
        _QUOTED,
        "'22,051' stands where a number with decimal mark '.'",
    ),
    refused(
        "thousands and decimal separators in one number",
        _SEMI.replace("22,051", "1.022,051"),
        "'1.022,051' stands where a number with decimal mark ','",
        separator=";",
        decimal=",",
    ),
    refused(
        "apostrophe as thousands separator",
        text(_scaled(2, 1e3), names=_names(F_n="mN")).replace("22051.0", "22'051"),
        '"22\'051" stands where a number',
    ),
    refused(
        "space as thousands separator",
        text(with_column(2, lambda k, old: old.replace(".", " "))),
        "'22 051' stands where a number",
    ),
    refused(
        "decimal points, with --decimal ,",
        text(),
        "a number with decimal mark ','",
        decimal=",",
    ),
    table(
        "exponent notation", text(with_column(1, lambda k, old: f"{float(old):.6e}"))
    ),
    refused(
        "word instead of a number",
        text(with_cell(17, 1, "fast")),
        "line 19, column v_t: 'fast' stands where a number",
    ),
    refused(
        "hexadecimal number",
        text(with_cell(3, 2, "0x1f")),
        "line 5, column F_n: '0x1f'",
    ),
    refused(
        "underscore between digits",
        text(with_cell(3, 2, "22_051")),
        "line 5, column F_n: '22_051'",
    ),
    refused(
        "OVERFLOW instead of a number",
        text(with_cell(3, 3, "OVERFLOW")),
        "line 5, column F_t: 'OVERFLOW'",
    ),
    table(
        "v_t in cm/s, stated in the header",
        text(_scaled(1, 100.0), names=_names(v_t="cm/s")),
    ),
    table(
        "v_t in um/s, stated by --unit", text(_scaled(1, 1e6)), units={"v_t": "um/s"}
    ),
    table(
        "F_n in kgf, F_t in gf",
        text(
            [
                [
                    r[0],
                    r[1],
                    repr(float(r[2]) / 9.80665),
                    repr(float(r[3]) / 9.80665e-3),
                ]
                for r in ROWS
            ],
            names=_names(F_n="kgf", F_t="gf"),
        ),
    ),
    table("F_n in lbf", text(_scaled(2, 1 / 4.4482216152605), names=_names(F_n="lbf"))),
    table("t in min", text(_scaled(0, 1 / 60.0), names=_names(t="min"))),
    refused(
        "F_n in g",
        text(_scaled(2, 100.0), names=_names(F_n="g")),
        "line 1: F_n is in 'g', which is a mass, not a force",
    ),
    table(
        "F_n in g, with --unit F_n=gf",
        text(_scaled(2, 1 / 9.80665e-3), names=_names(F_n="g")),
        units={"F_n": "gf"},
    ),
    refused("F_t in kg", text(names=_names(F_t="kg")), "kgf"),
    refused(
        "v_t in km/h",
        text(names=_names(v_t="km/h")),
        "'km/h', which is not a unit of",
    ),
    refused(
        "--unit that contradicts the header",
        text(names=_names(v_t="mm/s")),
        "mm/s by the table's header and in m/s by --unit",
        units={"v_t": "m/s"},
    ),
    flagged(
        "v_t in mm/s, unit not stated",
        text(_scaled(1, 1e3)),
        "--unit v_t=mm/s",
        expected=values(v_t=VALUES[:, 1] * 1e3),
    ),
    flagged(
        "F_n in mN, unit not stated",
        text(_scaled(2, 1e3)),
        "--unit F_n=mN",
        expected=values(F_n=VALUES[:, 2] * 1e3),
    ),
    refused(
        "t in ms, unit not stated",
        text(_scaled(0, 1e3)),
        "2 s between two rows; these look like ms. State it: --unit t=ms",
    ),
    refused("t in us, unit not stated", text(_scaled(0, 1e6)), "--unit t=us"),
    refused("t in ns, unit not stated", text(_scaled(0, 1e9)), "--unit t=ns"),
    table("t in ns with --unit t=ns", text(_scaled(0, 1e9)), units={"t": "ns"}),
    flagged(
        "one row per second (test conditions), with --unit t=s",
        text(with_column(0, lambda k, _: str(k))),
        "1 Hz: nothing is smoothed",
        units={"t": "s"},
        expected=values(t=np.arange(COUNT)),
    ),
    table(
        "seconds since 1970",
        text(with_column(0, lambda k, old: f"{1_700_000_000 + float(old):.3f}")),
        expected=values(
            t=np.array([float(f"{1_700_000_000 + t:.3f}") for t in _T]) - 1_700_000_000
        ),
    ),
    refused(
        "ms since 1970, unit not stated",
        text(_times(1_700_000_000, 1000)),
        "--unit t=ms",
    ),
    table(
        "ns since 1970, stated in the header",
        text(_times(1_048_576_000, 1_000_000_000), names=_names(t="ns")),
    ),
    table("ISO 8601 with time zone", text(_iso("Z"))),
    table("ISO 8601 with +01:00", text(_iso("+01:00"))),
    table("ISO 8601 without time zone, space before the time", text(_iso("", " "))),
    refused(
        "ISO 8601, one row without time zone",
        text(_iso("Z")).replace(".010Z", ".010"),
        "line 7, column t: '2026-11-26T10:00:00.010' stands where a time like",
    ),
    refused(
        "time of day without a date",
        text(with_column(0, lambda k, _: f"10:00:00.{2 * k:03d}")),
        "a number",
    ),
    refused(
        "30 February",
        text(_iso("Z")).replace("2026-11-26T10:00:00.004", "2026-02-30T10:00:00.004"),
        "line 4, column t",
    ),
    refused(
        "decreasing time in one row",
        text(with_cell(20, 0, "0.0370")),
        "line 22, column t: time does not increase (0.038 s, then 0.037 s)",
    ),
    refused(
        "two trials in one file",
        text(with_column(0, lambda k, _: f"{0.002 * (k % 30):.3f}")),
        "split the file at line 32",
    ),
    refused(
        "times with too few decimals",
        text(with_column(0, lambda k, old: f"{float(old):.2f}")),
        "leave t out and give --rate HZ",
    ),
    refused(
        "two rows with the same time",
        text(with_column(0, lambda k, old: "0.016" if k == 9 else old)),
        "Sort the rows by time, each time once",
    ),
    refused("rows in descending order of time", text(ROWS[::-1]), "--negate t"),
    table("duplicate row", text([*ROWS[:9], ROWS[8], *ROWS[9:]])),
    flagged(
        "gap of an hour within the trial",
        text(_HOUR[0]),
        "gap of 3600 s before line 32",
        expected=_HOUR[1],
    ),
    flagged(
        "time jump of ten years",
        text(_DECADE[0]),
        "gap of 3.15e+08 s before line 32",
        expected=_DECADE[1],
    ),
    refused(
        "country-specific date format",
        text(with_column(0, lambda k, _: f"11/26/2026 10:00:00.{2 * k:03d}")),
        "leave the column out and give --rate HZ",
    ),
    refused(
        "spreadsheet dates (days)",
        text(with_column(0, lambda k, _: f"{46352.5 + 0.002 * k / 86400:.10f}")),
        "these look like days. State it: --unit t=d",
    ),
    table(
        "foot at rest in a third of the rows, otherwise at constant speed",
        text(with_column(1, lambda k, _: "1.5" if k % 3 else "0")),
        expected=values(v_t=np.array([1.5 if k % 3 else 0.0 for k in range(COUNT)])),
    ),
    flagged(
        "9999 as missing value, in 4 % of the rows",
        text(with_column(2, lambda k, old: "9999" if k in {20, 21} else old)),
        "F_n is 9999 in 2 rows, the first is line 22",
        expected=_SENTINELS,
    ),
    flagged(
        "spike of 1e6 N in one row",
        text(with_cell(30, 3, "1000000")),
        "F_t is 1e+06 in line 32",
        expected=_SPIKED,
    ),
    flagged(
        "250 rows per second",
        text(_HALF),
        "250 Hz, not 500: averaged over 22 ms",
        expected=values(t=np.array([float(r[0]) for r in _HALF])),
    ),
    flagged(
        "20 rows per second",
        text(_SLOW),
        "20 Hz: nothing is smoothed, and slips are not seen",
        expected=values(t=np.array([float(r[0]) for r in _SLOW])),
    ),
    table(
        "plausible sliding foot",
        _pushed()[0],
        expected=_pushed()[1],
        doubts=True,
    ),
    flagged(
        "negative compression force",
        _pushed(F_n=-1)[0],
        "--negate F_n",
        expected=_pushed(F_n=-1)[1],
        doubts=True,
    ),
    table(
        "negative compression force, with --negate F_n",
        _pushed(F_n=-1)[0],
        expected=_pushed()[1],
        doubts=True,
        negate=["F_n"],
    ),
    flagged(
        "F_t with the wrong sign",
        _pushed(F_t=-1)[0],
        "--negate F_t",
        expected=_pushed(F_t=-1)[1],
        doubts=True,
    ),
    flagged(
        "v_t and F_t with the wrong sign",
        _pushed(v=-1, F_t=-1)[0],
        "--negate v_t",
        expected=_pushed(v=-1, F_t=-1)[1],
        doubts=True,
    ),
    flagged(
        "F_t zero throughout",
        _pushed(F_t=0)[0],
        "F_t is 0 throughout",
        expected=_pushed(F_t=0)[1],
        doubts=True,
    ),
    flagged(
        "F_n and F_t swapped",
        text(
            [
                [r[0], r[1], r[3], r[2]]
                for r in np.array(_pushed(F_n=10)[1]).astype(str).tolist()
            ]
        ),
        "--columns F_n=...,F_t=...",
        expected=_pushed(F_n=10)[1][:, [0, 1, 3, 2]],
        doubts=True,
    ),
)
