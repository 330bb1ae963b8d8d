"""Optional libraries, by the extra that installs them."""

from collections.abc import Mapping
from importlib.util import find_spec

from acquisition.errors import MissingLibraryError, SettingsError

# Module to import and name in the package index, by extra of the distribution.
EXTRAS: Mapping[str, Mapping[str, str]] = {
    "report": {"jinja2": "Jinja2", "matplotlib": "matplotlib", "PIL": "pillow"},
    "cluster": {"dask": "dask", "distributed": "distributed"},
    "live": {"foxglove": "foxglove-sdk"},
    "onnx": {"onnx": "onnx"},
    "pandas": {"pandas": "pandas"},
    "parquet": {"pyarrow": "pyarrow"},
    "publish": {"rocrate": "rocrate"},
}


def require_extra(extra: str) -> None:
    """Check early that the libraries of an extra are installed; imports nothing.

    Args:
        extra: one of `EXTRAS`.

    Raises:
        MissingLibraryError: a library is not installed.
    """
    for module, library in EXTRAS[extra].items():
        if not _is_installed(module):
            raise MissingLibraryError(library, extra)


def import_refusal(error: ImportError, module: str, extra: str) -> SettingsError:
    """Make the error for a failed import: the library is missing, or it is broken.

    Args:
        error: what the import raised.
        module: module of `EXTRAS` that was imported.
        extra: its extra.
    """
    library = EXTRAS[extra][module]
    if not _is_installed(module):
        return MissingLibraryError(library, extra)
    return SettingsError(
        f"The library {library} is installed and cannot be imported ({error}).",
        hint=f"Install it again: python -m pip install --force-reinstall {library}",
    )


def _is_installed(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):  # hidden, or a module without a specification
        return False
