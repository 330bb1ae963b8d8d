"""Parquet tables with units and origin; the only module that imports pyarrow."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from acquisition.errors import MissingLibraryError, SettingsError
from analysis.data.data_package import TableOrigin
from analysis.data.series import Array

MAGIC = b"PAR1"
MOST_ROWS = 500_000  # of a table; 17 minutes at 500 Hz
_MOST_COLUMNS = 1000
_KEY = b"traction"  # of the metadata of a file
_LEVEL = 9  # of zstd


def to_parquet(
    columns: Mapping[str, NDArray[np.generic]],
    units: Mapping[str, str],
    origin: TableOrigin | None = None,
) -> bytes:
    """Return a table as Parquet; pyarrow, pandas and DuckDB read it.

    Args:
        columns: values by name, all of shape (n,).
        units: by name; kept as the metadata "unit" of a column.
        origin: of the table; kept as the metadata "traction" of the file.

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
    """The columns that were wanted of a Parquet table.

    Attributes:
        columns: values by name, shape (n,); those that it lacks are left out.
        units: by name; "" where the file states none.
        names: of all its columns.
        origin: of the table, where the file states one.
    """

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    names: Sequence[str]
    origin: TableOrigin | None


def read_parquet(path: Path, names: Sequence[str]) -> ParquetTable:
    """Return the columns `names` of a file, as far as it has them.

    Args:
        path: the file; the caller has checked its size.
        names: the columns that are wanted.

    Raises:
        SettingsError: it is no Parquet file of numbers, or unpacks to too much.
        MissingLibraryError: pyarrow is not installed.
    """
    arrow = _arrow()
    try:
        with arrow.parquet.ParquetFile(path) as file:
            _check_shape(path, file.metadata)
            schema = file.schema_arrow
            wanted = [name for name in names if name in schema.names]
            table = file.read(columns=wanted, use_threads=False)
        values = {
            name: np.asarray(table.column(name).to_numpy(), dtype=np.float64)
            for name in wanted
        }
    except (arrow.ArrowException, OSError, MemoryError, TypeError, ValueError) as error:
        first = str(error).splitlines()[0][:200] if str(error) else repr(error)
        raise SettingsError(
            f"{path}: not a readable Parquet table of numbers ({first}).",
            hint="Check that it was copied completely.",
        ) from error
    units = {name: _unit(schema.field(name).metadata) for name in wanted}
    return ParquetTable(values, units, schema.names, _origin(schema.metadata))


def _check_shape(path: Path, about: Any) -> None:  # noqa: ANN401
    """Refuse what unpacks to too much, before it is unpacked."""
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


def _unit(metadata: Mapping[bytes, bytes] | None) -> str:
    return (metadata or {}).get(b"unit", b"").decode(errors="replace")


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
        import pyarrow.parquet
    except ImportError as error:
        raise MissingLibraryError("pyarrow", "parquet") from error
    return pyarrow
