"""Exported files on the disk, and exported modules as a user imports them."""

import importlib.util
import sys

from analysis.exports.folder import target_files
from tests.analysis.exports.databases import export


def write(folder, target, **options):
    """Write what a target makes of the two terrains into `folder`, and return it."""
    for path, content in target_files(target, export(**options)).items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    return folder


def load_module(folder, name, monkeypatch):
    """Return an exported module, those beside it first on the path."""
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "traction_profile", raising=False)
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def largest_distance(drawn, shares, quantiles):
    """Return Kolmogorov and Smirnov's distance of draws from a table of quantiles."""
    import numpy as np

    x = np.sort(drawn)
    expected = np.interp(x, quantiles, shares, left=0.0, right=1.0)
    n = x.size
    above = np.arange(1, n + 1) / n - expected
    below = expected - np.arange(n) / n
    return float(max(above.max(), below.max()))
