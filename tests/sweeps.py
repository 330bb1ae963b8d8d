"""Sweeps of a value: a few in the default suite, the others in `.ci/run`."""

from collections.abc import Collection, Sequence
from typing import Any

import pytest


def swept(cases: Sequence[Any], quick: Collection[Any]) -> list[Any]:
    """The cases of a sweep as parameters; those outside `quick` are slow."""
    assert {*quick} <= {*cases}
    return [case if case in quick else _slow(case) for case in cases]


def _slow(case: Any) -> Any:
    values = case if isinstance(case, tuple) else (case,)
    return pytest.param(*values, marks=pytest.mark.slow)
