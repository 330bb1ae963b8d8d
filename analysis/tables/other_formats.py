"""Recognition of other file formats by their first bytes."""

from pathlib import Path
from typing import NamedTuple

from acquisition.errors import SettingsError
from analysis.tables.refusals import refusal

ENOUGH = 20  # bytes needed to recognise a format


class _Kind(NamedTuple):
    start: bytes
    name: str
    remedy: str


_SAVE = "Save the sheet as CSV UTF-8, and give that."
_KINDS = (
    _Kind(b"\xd0\xcf\x11\xe0", "an old Excel workbook", _SAVE),
    _Kind(
        b"\x93NUMPY",
        "a NumPy array without a terrain",
        "Give it one: python -c \"import numpy; numpy.savez('trials.npz', "
        "**{{'S0/01': numpy.load('{path}')}})\" with the columns t, v_t, F_n, F_t.",
    ),
    _Kind(
        b"MATLAB 5.0 MAT-file",
        "a MATLAB file",
        "In MATLAB: writetable(table(t, v_t, F_n, F_t), 'trial.csv'); or read it with "
        "scipy.io.loadmat and save a CSV.",
    ),
    _Kind(
        b"\x89HDF",
        "an HDF5 file (MATLAB 7.3, h5py, pandas)",
        "Save t, v_t, F_n and F_t as CSV or Parquet, e.g. pandas.read_hdf('{path}')"
        ".to_csv('trial.csv', index=False).",
    ),
    _Kind(
        b"\x89MCAP",
        "an MCAP recording",
        "traction report SESSION fits recorded trials; traction export makes tables.",
    ),
    _Kind(
        b"#ROSBAG",
        "a ROS bag",
        "Save t, v_t, F_n and F_t as CSV or Parquet: it holds topics, no traction.",
    ),
    _Kind(
        b"SQLite format 3",
        "an SQLite database",
        "Save t, v_t, F_n and F_t as CSV, e.g. with sqlite3 -csv -header.",
    ),
    _Kind(b"TDSm", "a LabVIEW TDMS file", "Save it as CSV."),
    _Kind(b"BZh", "packed by bzip2", "Unpack it: bunzip2 -k '{path}'"),
    _Kind(b"\xfd7zXZ", "packed by xz", "Unpack it: unxz -k '{path}'"),
    _Kind(b"\x28\xb5\x2f\xfd", "packed by zstd", "Unpack it: unzstd '{path}'"),
    _Kind(b"%PDF", "a PDF", "Give the table itself as CSV."),
    _Kind(b"ARROW1", "an Arrow (Feather) file", "Save it with to_parquet."),
)


def check_kind(path: Path, start: bytes) -> None:
    """Refuse a file of another format.

    Args:
        path: the file.
        start: its first `ENOUGH` bytes, or all if it is shorter.

    Raises:
        SettingsError: the file is not a table; the hint says how to convert it.
    """
    for kind in _KINDS:
        if start.startswith(kind.start):
            raise refusal(path, f"this is {kind.name}", kind.remedy.format(path=path))


def not_an_npz(path: Path, members: list[str]) -> SettingsError:
    """Make the error for an archive that is not an npz of trials."""
    if "[Content_Types].xml" in members:
        return refusal(path, "this is an Excel workbook", _SAVE)
    if "mimetype" in members:
        return refusal(path, "this is an OpenDocument file", _SAVE)
    others = ", ".join(members[:5]) or "nothing"
    return refusal(
        path,
        f"no table of trials (it holds {others:.200s})",
        "An npz holds arrays TERRAIN/NN of four columns: t, v_t, F_n, F_t.",
    )
