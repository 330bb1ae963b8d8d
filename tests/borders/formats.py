"""Parquet and npz, and files of other formats given as tables."""

import gzip
import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from analysis.tables.loading import load_tables
from tests.borders.row import Answer, Border, Outcome
from tests.borders.tables import NAMES, VALUES, flagged, judged, refused, table, values

_NS = (VALUES[:, 0] * 1e9).round().astype(np.int64)
_READ, _FLAGGED, _REFUSED = Outcome.READ, Outcome.FLAGGED, Outcome.REFUSED


def _columns(**others: Any) -> dict[str, Any]:
    columns = dict(zip(NAMES, VALUES.T, strict=True))
    return {others.get(f"name_{n}", n): others.get(n, x) for n, x in columns.items()}


def _parquet(
    given: str,
    content: Mapping[str, Any],
    outcome: Outcome = _READ,
    says: str = "",
    expected: np.ndarray | None = None,
    units: Mapping[str, str] | None = None,
    **options: Any,
) -> Border:
    def act(folder: Path) -> Answer:
        import pyarrow as pa
        import pyarrow.parquet as pq

        arrays = {name: pa.array(column) for name, column in content.items()}
        fields = [
            pa.field(n, a.type, metadata={"unit": (units or {}).get(n, "")})
            for n, a in arrays.items()
        ]
        path = folder / "trial.parquet"
        pq.write_table(pa.table(list(arrays.values()), pa.schema(fields)), path)
        return judged(lambda: load_tables([path], **options), expected, doubts=False)

    return Border(f"Parquet: {given}", outcome, says, act)


def _archive(*names: str) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in names:
            archive.writestr(name, "x")
    return stream.getvalue()


def _npz(array: np.ndarray, name: str = "S0/01") -> bytes:
    stream = io.BytesIO()
    arrays: Any = {name: array}
    np.savez(stream, **arrays)
    return stream.getvalue()


def _npy() -> bytes:
    stream = io.BytesIO()
    np.save(stream, VALUES)
    return stream.getvalue()


_HOLES = VALUES[:, 2].tolist()
_HOLES[3] = None
_STATED = {"v_t": "cm/s"}
FORMATS: tuple[Border, ...] = (
    _parquet("float64 columns", _columns()),
    _parquet(
        "F_n [N], no columns given",
        _columns(name_F_n="F_n [N]"),
    ),
    _parquet(
        "v_t [cm/s] selected by its full name keeps its unit",
        _columns(name_v_t="v_t [cm/s]", v_t=VALUES[:, 1] * 100),
        columns={"v_t": "v_t [cm/s]"},
    ),
    _parquet(
        "v_t in cm/s, stated in the metadata",
        _columns(v_t=VALUES[:, 1] * 100),
        units=_STATED,
    ),
    _parquet(
        "unit in the name contradicts the metadata",
        _columns(name_v_t="v_t [m/s]"),
        _REFUSED,
        "in cm/s and in m/s by its name",
        units={"v_t [m/s]": "cm/s"},
    ),
    _parquet("timestamp[ns]", _columns(t=(_NS + 1_700_000_000 * 10**9).view("M8[ns]"))),
    _parquet("duration[ns]", _columns(t=_NS.view("m8[ns]"))),
    _parquet("timestamp[us]", _columns(t=(_NS // 1000).view("M8[us]"))),
    _parquet("integer times in ns", _columns(t=_NS), _REFUSED, "--unit t=ns"),
    _parquet(
        "null value",
        _columns(F_n=_HOLES),
        _FLAGGED,
        "1 row without a value dropped, the first is row 4",
        expected=np.delete(VALUES, 3, axis=0),
    ),
    _parquet(
        "column of strings",
        _columns(F_t=["a"] * len(VALUES)),
        _REFUSED,
        "column F_t holds string, numbers were expected",
    ),
    _parquet(
        "column of booleans",
        _columns(F_t=[True] * len(VALUES)),
        _REFUSED,
        "column F_t holds bool, numbers were expected",
    ),
    _parquet(
        "other column names",
        _columns(name_v_t="speed", name_F_n="Fz"),
        _REFUSED,
        "--columns t=t,v_t=speed,F_n=Fz,F_t=F_t",
    ),
    _parquet(
        "spike of 1e6 N in one row",
        _columns(F_t=np.where(np.arange(len(VALUES)) == 7, 1e6, VALUES[:, 3])),
        _FLAGGED,
        "F_t is 1e+06 in row 8",
        expected=values(F_t=np.where(np.arange(len(VALUES)) == 7, 1e6, VALUES[:, 3])),
    ),
    table("npz: array of a trial", _npz(VALUES)),
    refused(
        "npz: array of three columns",
        _npz(VALUES[:, :3]),
        "array S0/01 has shape (60, 3)",
    ),
    flagged(
        "npz: times in ms",
        _npz(VALUES * [1e3, 1, 1, 1]),
        "0.5 Hz: nothing is smoothed",
        expected=VALUES * [1e3, 1, 1, 1],
    ),
    refused("npy: single array", _npy(), "numpy.savez('trials.npz'"),
    refused("Excel workbook (xlsx)", _archive("[Content_Types].xml"), "as CSV UTF-8"),
    refused("old Excel workbook (xls)", b"\xd0\xcf\x11\xe0\xa1\xb1", "as CSV UTF-8"),
    refused("OpenDocument spreadsheet", _archive("mimetype"), "as CSV UTF-8"),
    refused("other zip archive", _archive("readme.txt"), "it holds readme.txt"),
    refused("MATLAB file", b"MATLAB 5.0 MAT-file, Platform: GLNXA64", "writetable"),
    refused("HDF5 file", b"\x89HDF\r\n\x1a\n", "to_csv('trial.csv'"),
    refused("MCAP recording", b"\x89MCAP0\r\n", "traction report SESSION"),
    refused("ROS bag", b"#ROSBAG V2.0\n", "it holds topics"),
    refused("SQLite database", b"SQLite format 3\0", "sqlite3 -csv"),
    refused("LabVIEW TDMS file", b"TDSm\x0e\0\0\0", "Save it as CSV"),
    refused("bzip2-compressed file", b"BZh91AY&SY", "bunzip2 -k"),
    refused("xz-compressed file", b"\xfd7zXZ\0", "unxz -k"),
    refused("zstd-compressed file", b"\x28\xb5\x2f\xfd\0", "unzstd"),
    refused("PDF", b"%PDF-1.7", "Give the table itself"),
    refused(
        "gzip-compressed PDF",
        gzip.compress(b"%PDF-1.7\n%x\n"),
        "no column t, v_t, F_n, F_t",
    ),
)
