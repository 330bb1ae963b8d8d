"""Parquet tables with units and origin. The only module that imports pyarrow."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from acquisition.errors import SettingsError
from acquisition.extras import import_refusal
from analysis.data.series import Array
from analysis.tables.columns import (
    PREPARED,
    SIMULATED,
    columns_hint,
    find_column,
    place_hint,
    plain,
    split_header,
)
from analysis.tables.data_package import TableOrigin
from analysis.tables.refusals import refusal

MAGIC = b"PAR1"
MOST_ROWS = 500_000  # per table; 17 minutes at 500 Hz
_MOST_COLUMNS = 1000
_KEY = b"traction"  # key in the file metadata
_LEVEL = 9  # zstd compression level


def to_parquet(
    columns: Mapping[str, NDArray[np.generic]],
    units: Mapping[str, str],
    origin: TableOrigin | None = None,
) -> bytes:
    """Encode a table as Parquet, readable by pyarrow, pandas and DuckDB.

    Args:
        columns: values by name, all of shape (n,).
        units: units by name; stored as metadata "unit" of a column.
        origin: origin of the table; stored as metadata "traction" of the file.

    Raises:
        MissingLibraryError: pyarrow is not installed.
    """
    arrow = _arrow()
    arrays = [_arrow_array(arrow, values) for values in columns.values()]
    fields = [
        arrow.field(name, array.type, metadata={"unit": units.get(name, "")})
        for name, array in zip(columns, arrays, strict=True)
    ]
    about = {} if origin is None else {_KEY: origin.model_dump_json()}
    table = arrow.Table.from_arrays(arrays, schema=arrow.schema(fields, about))
    sink = arrow.BufferOutputStream()
    words = [name for name, column in columns.items() if column.dtype.kind in "US"]
    arrow.parquet.write_table(
        table, sink, compression="zstd", compression_level=_LEVEL, use_dictionary=words
    )
    return sink.getvalue().to_pybytes()


@dataclass(frozen=True, slots=True)
class ParquetTable:
    """Selected columns of a Parquet table.

    Attributes:
        columns: values by column of the analysis, shape (n,); NaN for a missing one.
        units: unit by column of the analysis; "" if the file states none.
        is_prepared: the file has the column of kept samples.
        is_simulated: value of the column `simulated`; None without one.
        origin: origin of the table; None if not stated.
    """

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    is_prepared: bool
    is_simulated: bool | None
    origin: TableOrigin | None


def read_parquet(path: Path, columns: Mapping[str, str]) -> ParquetTable:
    """Read columns of a file by name, as `v_t` or `v_t [cm/s]`, or position.

    Args:
        path: the file; its size must have been checked.
        columns: name in the file by column of the analysis.

    Raises:
        SettingsError: a column is missing, the file is not a Parquet table of numbers,
            or it is too large unpacked.
        MissingLibraryError: pyarrow is not installed.
    """
    arrow = _arrow()
    try:
        with arrow.parquet.ParquetFile(path) as file:
            _check_shape(path, file.metadata)
            schema = file.schema_arrow
            places = _places(path, schema.names, columns)
            mark = find_column(schema.names, SIMULATED)
            wanted = sorted({*places.values(), *mark[:1]})
            # by position: names may be duplicated, and dots are interpreted as paths
            table = file.read(use_threads=False).select(wanted)
        at = {place: table.column(k) for k, place in enumerate(wanted)}
        values = {
            name: _numbers(arrow, path, schema.names[place], at[place])
            for name, place in places.items()
        }
        is_simulated = _mark(path, at[mark[0]]) if mark else None
    except (arrow.ArrowException, OSError, MemoryError, TypeError, ValueError) as error:
        first = str(error).splitlines()[0][:200] if str(error) else repr(error)
        raise SettingsError(
            f"{path}: not a readable Parquet table of numbers ({first}).",
            hint="Check that it was copied completely.",
        ) from error
    units = {name: _unit(path, schema, place) for name, place in places.items()}
    is_prepared = bool(find_column(schema.names, PREPARED))
    origin = _origin(schema.metadata)
    return ParquetTable(values, units, is_prepared, is_simulated, origin)


def _places(
    path: Path, header: Sequence[str], columns: Mapping[str, str]
) -> dict[str, int]:
    """Return the position of each column, from 0."""
    matches = {name: find_column(header, plain(c)) for name, c in columns.items()}
    missing = [columns[name] for name, places in matches.items() if not places]
    if missing:
        names = ", ".join(header)[:300] or "none"
        reason = f"no column {', '.join(missing)}; it has {names}"
        raise refusal(path, reason, columns_hint(header, columns))
    for name, places in matches.items():
        if len(places) > 1:
            reason = f"column {columns[name]} occurs twice"
            raise refusal(path, reason, place_hint(name, places))
    return {name: places[0] for name, places in matches.items()}


def _numbers(arrow: Any, path: Path, name: str, column: Any) -> Array:  # noqa: ANN401
    """Return the values of a column; times are counted from the first."""
    kind = column.type
    types = arrow.types
    if types.is_timestamp(kind) or types.is_duration(kind):
        ticks = column.cast(arrow.int64())
        first = next((t.as_py() for t in ticks if t.is_valid), 0)
        ticks = arrow.compute.subtract(ticks, arrow.scalar(first, arrow.int64()))
        return np.asarray(ticks.to_numpy(), dtype=np.float64)
    if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
        if types.is_decimal(kind):
            column = column.cast(arrow.float64())
        return np.asarray(column.to_numpy(), dtype=np.float64)
    raise refusal(
        path,
        f"column {name} holds {kind}, numbers were expected",
        "Convert it, e.g. with pandas.to_numeric, and save it again.",
    )


def _mark(path: Path, column: Any) -> bool:  # noqa: ANN401
    """Return the value of the column `simulated`; it must be the same in all rows."""
    values = {bool(value) for value in column.unique().to_pylist()}
    if len(values) > 1:
        raise refusal(
            path,
            f"column {SIMULATED} is 0 in some rows and 1 in others",
            "Keep simulated and recorded trials in separate files.",
        )
    return True in values


def _check_shape(path: Path, about: Any) -> None:  # noqa: ANN401
    """Refuse a table with too many rows or columns, before unpacking."""
    if about.num_rows > MOST_ROWS or about.num_columns > _MOST_COLUMNS:
        raise SettingsError(
            f"{path}: {about.num_rows} rows of {about.num_columns} columns, the limit "
            f"is {MOST_ROWS} of {_MOST_COLUMNS}.",
            hint="Give one table per trial.",
        )


def _arrow_array(arrow: Any, values: NDArray[np.generic]) -> Any:  # noqa: ANN401
    if values.dtype.kind in "US":
        return arrow.array(values.tolist(), type=arrow.string())
    return arrow.array(values)


def _unit(path: Path, schema: Any, place: int) -> str:  # noqa: ANN401
    """Return the unit stated by type, name or metadata of a column; "" for none."""
    field = schema.field(place)
    metadata = field.metadata or {}
    stated = {
        split_header(field.name)[1],
        metadata.get(b"unit", b"").decode(errors="replace"),
        _unit_of_type(str(field.type)),
    }
    stated = {plain(unit) for unit in stated} - {""}
    if len(stated) > 1:
        raise refusal(
            path,
            f"column {field.name} is in {' and in '.join(sorted(stated))} by its name, "
            "type and metadata",
            "Save it again with one unit.",
        )
    return stated.pop() if stated else ""


def _unit_of_type(kind: str) -> str:
    """Return the unit of `timestamp[ns]`, `timestamp[us, tz=UTC]` or `duration[ms]`."""
    match = re.fullmatch(r"(?:timestamp|duration)\[(\w+)(?:, .*)?\]", kind)
    return match[1] if match else ""


def _origin(metadata: Mapping[bytes, bytes] | None) -> TableOrigin | None:
    text = (metadata or {}).get(_KEY)
    if text is None:
        return None
    try:
        return TableOrigin.model_validate(json.loads(text))
    except (ValidationError, ValueError, RecursionError):
        return None


def _arrow() -> Any:  # noqa: ANN401
    try:
        import pyarrow
        import pyarrow.compute
        import pyarrow.parquet
    except ImportError as error:
        raise import_refusal(error, "pyarrow", "parquet") from error
    return pyarrow
