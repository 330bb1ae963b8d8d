"""Traction in a notebook or script: recorded trials, tables and models.

    import traction as tr

    session = tr.load_session("S002")       # kept trials of a recorded session, or
    trial = tr.load_trial("T04.mcap")       # one recorded trial or table, or
    tables = tr.load_tables("tables")       # what `traction export` wrote
    session["T01"].plot()                   # as the report draws it
    frame = session.to_pandas()             # units in frame.attrs["units"]
    model = tr.fit(session, "tustin")       # or a Gaussian process
    scores = tr.compare(session)            # one whole trial left out at a time
    known = tr.load_terrains("terrains.json")

SI units throughout: forces in N, velocities in m/s; v_t and F_t are positive in
ordinary slip, F_n in compression. `analysis.api` has the functions below these.
Begin with `loading`, then `models`.
"""

from typing import Any

import lazy_loader

from traction.installation import check_packages

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    check_packages()
    if name == "__version__":
        from importlib.metadata import version

        return version("traction")
    return _load(name)
