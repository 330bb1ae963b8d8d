"""Layouts of text tables: encoding, header, delimiter, units row, missing rows."""

import gzip

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
    without,
)

_PLAIN = text()
_HEAD = "t,v_t,F_n,F_t\n"
_LINES = _PLAIN.splitlines()
_MM = with_column(1, lambda k, old: f"{float(old) * 1e3:.2f}")
_WIDE = [[*row, "7.5", "on"] for row in ROWS]
_MIXED = [[row[3], "9", row[1], row[2], row[0]] for row in ROWS]
_PADDED = "\n".join("".join(f"{cell:>12}" for cell in row) for row in [NAMES, *ROWS])

LAYOUTS: tuple[Border, ...] = (
    table("comma-separated, decimal points", _PLAIN),
    table("CRLF line endings", _PLAIN.replace("\n", "\r\n")),
    table("CR line endings", _PLAIN.replace("\n", "\r")),
    table("no newline after the last row", _PLAIN[:-1]),
    table("blank lines between rows", _PLAIN.replace("\n", "\n\n")),
    table("UTF-8 with a byte-order mark", "\ufeff" + _PLAIN),
    table("UTF-16 LE with a byte-order mark", b"\xff\xfe" + _PLAIN.encode("utf-16-le")),
    table("UTF-16 BE with a byte-order mark", b"\xfe\xff" + _PLAIN.encode("utf-16-be")),
    refused(
        "UTF-16 without a byte-order mark",
        _PLAIN.encode("utf-16-le"),
        "line 1: a zero byte; this is not UTF-8 text",
    ),
    refused(
        "UTF-16 truncated within a character",
        b"\xff\xfe" + _PLAIN.encode("utf-16-le")[:-1],
        "is not UTF-16",
    ),
    table("Ctrl-Z after the last row", _PLAIN + "\x1a"),
    table(
        "units after a slash",
        text(_MM, names=("t/s", "v_t/mm/s", "F_n/N", "F_t/N")),
    ),
    table(
        "column selected by a name that contains a unit",
        text(names=("t", "speed m/s", "F_n", "F_t")),
        columns={"v_t": "speed m/s"},
    ),
    refused("UTF-32", b"\xff\xfe\0\0" + _PLAIN.encode("utf-32-le"), "a zero byte"),
    refused(
        "Windows-1252 byte in a comment",
        b"# Kr\xe4fte\n" + _PLAIN.encode(),
        "line 1: byte 0xe4",
    ),
    refused("NUL byte in line 3", "t,v_t,F_n,F_t\n1,2,3,4\n5,\0,6,7\n", "line 3"),
    table("semicolon-separated, decimal points", text(delimiter=";"), separator=";"),
    table(
        "semicolon-separated, decimal commas",
        text(delimiter=";", mark=","),
        separator=";",
        decimal=",",
    ),
    table("tab-separated, decimal points", text(delimiter="\t"), separator="\t"),
    table(
        "tab-separated, decimal commas",
        text(delimiter="\t", mark=","),
        separator="\t",
        decimal=",",
    ),
    table("separated by single spaces", text(delimiter=" "), separator="blanks"),
    table("columns padded with spaces", _PADDED, separator="blanks"),
    refused("semicolon-separated, without --sep", text(delimiter=";"), "--sep ';'"),
    refused("tab-separated, without --sep", text(delimiter="\t"), "--sep tab"),
    refused("space-separated, without --sep", text(delimiter=" "), "--sep blanks"),
    refused(
        "decimal commas, without --decimal",
        text(delimiter=";", mark=","),
        "Decimal marks ',': --decimal ,",
        separator=";",
    ),
    refused(
        "a letter as separator", _PLAIN, "'e' cannot separate columns", separator="e"
    ),
    table("spaces after the commas", text(delimiter=", ")),
    table(
        "comma-separated, quoted cells with decimal commas",
        text([['"' + c.replace(".", ",") + '"' for c in row] for row in ROWS]),
        decimal=",",
    ),
    table(
        "sep=; in the first line, skipped",
        "sep=;\n" + text(delimiter=";"),
        separator=";",
        skipped=frozenset({1}),
    ),
    refused(
        "sep=; in the first line, not skipped",
        "sep=;\n" + text(delimiter=";"),
        "the names of the columns are in line 2",
        separator=";",
    ),
    refused(
        "trailing comma in every row",
        text([[*row, ""] for row in ROWS]),
        "line 2: 5 cells below 4 names",
    ),
    table("additional columns", text(_WIDE, names=(*NAMES, "T", "state"))),
    table(
        "columns in another order", text(_MIXED, names=("F_t", "x", "v_t", "F_n", "t"))
    ),
    table("quoted column names", text(names=[f'"{name}"' for name in NAMES])),
    table(
        "column selected by a quoted name with a comma",
        text(names=['"Time, elapsed"', *NAMES[1:]]),
        columns={"t": "Time, elapsed"},
    ),
    table(
        "other column names, mapped by columns",
        text(names="abcd"),
        columns=dict(zip(NAMES, "abcd", strict=True)),
    ),
    refused(
        "other column names, not mapped",
        text(names=("Time", "v", "Fz", "Fx")),
        "--columns t=Time,v_t=v,F_n=Fz,F_t=Fx",
    ),
    refused(
        "missing column",
        text(names=("t", "v_t", "F_n", "state")),
        "no column F_t; it has t, v_t, F_n, state",
    ),
    refused(
        "duplicate column name",
        text(_WIDE, names=(*NAMES, "F_t", "x")),
        "--columns F_t=4 or F_t=5",
    ),
    table(
        "duplicate column name, selected by position",
        text(_WIDE, names=(*NAMES, "F_t", "x")),
        columns={"F_t": "4"},
    ),
    refused(
        "no header",
        "\n".join(_LINES[1:]),
        "4 numbers instead of the names of the columns",
    ),
    table(
        "columns selected by position keep the header's unit",
        text(_MM, names=("a", "b [mm/s]", "c", "d")),
        columns=dict(zip(NAMES, "1234", strict=True)),
    ),
    table(
        "lines before the header, skipped",
        "Machine 7\nOperator: mk, room 3\n\n" + _PLAIN,
        skipped=frozenset({1, 2, 3}),
    ),
    refused(
        "lines before the header",
        "Machine 7\nOperator: mk, room 3\n\n" + _PLAIN,
        "line 1: the names of the columns are in line 4. Skip the lines above "
        "them: --skip 1-3",
    ),
    refused(
        "--skip of a line that does not exist",
        _PLAIN,
        "--skip 99",
        skipped=frozenset({99}),
    ),
    table(
        "header after # (numpy.savetxt)",
        "# " + text(delimiter=" "),
        separator="blanks",
    ),
    table(
        "units in square brackets",
        text(_MM, names=("t [s]", "v_t [mm/s]", "F_n [N]", "F_t [N]")),
    ),
    table(
        "units in parentheses",
        text(_MM, names=("t (s)", "v_t(mm/s)", "F_n (N)", "F_t")),
    ),
    refused(
        "units in a space-separated header",
        text(_MM, " ", ("t [s]", "v_t [mm/s]", "F_n [N]", "F_t [N]")),
        "line 2: 4 cells below 8 names",
        separator="blanks",
    ),
    table(
        "row of units, skipped and stated by --unit",
        text([["s", "mm/s", "N", "N"], *_MM]),
        skipped=frozenset({2}),
        units={"v_t": "mm/s"},
    ),
    refused(
        "row of units",
        text([["s", "mm/s", "N", "N"], *_MM]),
        "line 2, column t: 's' stands where a number",
    ),
    table(
        "micro as U+03BC",
        text(
            with_column(0, lambda k, _: str(2000 * k)),
            names=("t [\u03bcs]", *NAMES[1:]),
        ),
    ),
    table(
        "micro as U+00B5",
        text(
            with_column(0, lambda k, _: str(2000 * k)),
            names=("t [\u00b5s]", *NAMES[1:]),
        ),
    ),
    table(
        "minus as U+2212",
        text(with_column(1, lambda k, old: "\u2212" + old)),
        expected=values(v_t=-VALUES[:, 1]),
    ),
    table(
        "no-break spaces around numbers",
        text(with_column(2, lambda k, old: f"\u00a0{old}\u00a0")),
    ),
    refused("truncated row", _PLAIN[:-20], f"line {COUNT + 1}: "),
    refused(
        "row with an extra cell",
        _PLAIN.replace(_LINES[9], _LINES[9] + ",1"),
        "line 10: 5 cells below 4 names",
    ),
    refused(
        "row names without a header (write.table of R)",
        text([[str(k), *row] for k, row in enumerate(ROWS, 1)], " "),
        "line 2: 5 cells below 4 names",
        separator="blanks",
    ),
    refused(
        "comma-separated, unquoted decimal commas",
        text(mark=","),
        "line 2: 8 cells below 4 names",
    ),
    refused(
        "unterminated quote",
        _PLAIN.replace(_LINES[9], '"' + _LINES[9]),
        "line 10: its quotes do not fit",
    ),
    refused(
        "second header in the middle (two files concatenated)",
        _PLAIN + _PLAIN,
        f"line {COUNT + 2}, column t: 't' stands where",
    ),
    refused(
        "footer line",
        _PLAIN + "end of file\n",
        f"line {COUNT + 2}: 1 cells below 4 names",
    ),
    refused("empty file", "", "the file is empty"),
    refused("header without rows", _HEAD, "no rows"),
    refused(
        "prose instead of a table",
        "Dear colleague,\nplease find the data below.\n",
        "no column t, v_t, F_n, F_t; it has Dear colleague",
    ),
    refused(
        "line of 70,000 characters", _HEAD + "1" * 70_000, "line 2: a line exceeds"
    ),
    table(
        "gzip-compressed CSV",
        gzip.compress(_PLAIN.encode(), mtime=0),
        file="trial.csv.gz",
    ),
    refused(
        "truncated gzip-compressed CSV",
        gzip.compress(_PLAIN.encode(), mtime=0)[:-30],
        "gzip cannot unpack it",
    ),
    refused(
        "30 kB that decompress to 30 MB",
        gzip.compress(b"0" * 30_000_000, mtime=0),
        "unpacks to more than 24 MB",
    ),
    flagged(
        "empty cell",
        text(with_cell(4, 2, "")),
        "1 row without a value dropped, the first is line 6",
        expected=without(4),
    ),
    flagged(
        "NaN, NA, N/A, #N/A, null and - as missing values",
        text(
            with_column(
                3,
                lambda k, old: (
                    ("NaN", "NA", "N/A", "#N/A", "null", "-")[k] if k < 6 else old
                ),
            )
        ),
        "6 rows without a value dropped",
        expected=without(*range(6)),
    ),
    flagged(
        "infinite value (inf)",
        text(with_cell(8, 1, "inf")),
        "1 row with an infinite value dropped, the first is line 10",
        expected=without(8),
    ),
    refused(
        "force missing in every other row",
        text(with_column(2, lambda k, old: "" if k % 2 else old)),
        "30 of 60 rows lack a value, most of them in F_n; the first is line 3",
    ),
    table(
        "missing value in an unused column",
        text([[*row, ""] for row in ROWS], names=(*NAMES, "T")),
    ),
    table(
        "no time column, with --rate",
        text([row[1:] for row in ROWS], names=NAMES[1:]),
        rate=500.0,
        expected=values(t=np.arange(COUNT) / 500.0),
    ),
    refused(
        "no time column",
        text([row[1:] for row in ROWS], names=NAMES[1:]),
        "--rate HZ",
    ),
    refused("--rate with a time column", _PLAIN, "it has a time column", rate=500.0),
)
