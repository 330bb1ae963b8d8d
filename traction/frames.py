"""Tables as pandas data frames; the only module that imports pandas."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from acquisition.extras import import_refusal

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pandas import DataFrame


def data_frame(
    columns: Mapping[str, Any], units: Mapping[str, str], **about: object
) -> DataFrame:
    """Return columns as a data frame.

    Args:
        columns: values by column name, all of shape (n,).
        units: unit by column name; stored in `attrs["units"]`.
        about: further entries of `attrs`.

    Raises:
        MissingLibraryError: pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError as error:
        raise import_refusal(error, "pandas", "pandas") from error
    frame = pd.DataFrame(dict(columns))
    frame.attrs.update(units=dict(units), **about)
    return frame
