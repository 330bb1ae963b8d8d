"""Validation of the loads and velocities passed to a query."""

import numpy as np
from numpy.typing import ArrayLike

from acquisition.errors import SettingsError
from analysis.data.series import Array


def points_of(F_n: ArrayLike, v_t: ArrayLike) -> tuple[Array, Array]:
    """Convert normal forces [N] and velocities [m/s] to arrays of one shape (n,).

    Raises:
        SettingsError: the values are not finite numbers or differ in shape.
    """
    loads, speeds = _numbers("F_n", F_n), _numbers("v_t", v_t)
    try:
        loads, speeds = np.broadcast_arrays(loads, speeds)
    except ValueError as error:
        raise SettingsError(
            f"F_n and v_t do not have one shape ({error}).",
            hint="Give two numbers, or two arrays of one length.",
        ) from error
    return loads, speeds


def _numbers(name: str, values: ArrayLike) -> Array:
    try:
        array = np.atleast_1d(np.asarray(values))
    except ValueError as error:  # rows of unequal length
        raise _no_numbers(name, values) from error
    if array.dtype.kind not in "fiu" or array.ndim != 1:
        raise _no_numbers(name, values)
    array = array.astype(np.float64)
    if not np.isfinite(array).all():
        raise SettingsError(f"{name} has to be finite.", hint="Leave NaN and inf out.")
    return array


def _no_numbers(name: str, values: ArrayLike) -> SettingsError:
    return SettingsError(
        f"{name} = {values!r:.60} is neither a number nor a row of numbers.",
        hint=f"Write e.g. {name}=3.5, or an array of shape (n,).",
    )
