"""Traction in a notebook or script: recorded trials, tables and models.

    import traction as tr

    session = tr.load_session("S002")       # kept trials of a recorded session, or
    trial = tr.load_trial("T04.mcap")       # one recorded trial or table, or
    tables = tr.load_tables("tables")       # what `traction export` wrote
    session["T01"].plot()                   # the figure of the report
    frame = session.to_pandas()             # units in frame.attrs["units"]
    model = tr.fit(session, "tustin")       # or a Gaussian process
    scores = tr.compare(session)            # leave-one-trial-out cross-validation
    limits = tr.fit_break_away(tables)      # force at which a foot at rest slips
    terrains = tr.load_terrains("terrains.json")
    session = tr.simulate("S0", trials=10)  # same as `traction run --fake --fast`

SI units throughout: forces in N, velocities in m/s; v_t and F_t are positive in
ordinary slip, F_n in compression. Begin with `loading`, then `models`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from traction.installation import check_packages

if TYPE_CHECKING:
    from traction.loading import load_session, load_tables, load_trial
    from traction.models import (
        Comparison,
        Model,
        ModelScore,
        compare,
        fit,
        fit_break_away,
        load_terrains,
    )
    from traction.simulations import simulate
    from traction.trial_sets import TrialSet
    from traction.trials import Trial

    __version__: str

# Imported on first use, since the program `traction` starts through this package.
_MODULES = {
    "Comparison": "models",
    "Model": "models",
    "ModelScore": "models",
    "Trial": "trials",
    "TrialSet": "trial_sets",
    "compare": "models",
    "fit": "models",
    "fit_break_away": "models",
    "load_session": "loading",
    "load_tables": "loading",
    "load_terrains": "models",
    "load_trial": "loading",
    "simulate": "simulations",
}

__all__ = [
    "Comparison",
    "Model",
    "ModelScore",
    "Trial",
    "TrialSet",
    "check_packages",
    "compare",
    "fit",
    "fit_break_away",
    "load_session",
    "load_tables",
    "load_terrains",
    "load_trial",
    "simulate",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    check_packages()
    if name == "__version__":
        from importlib.metadata import version

        return version("traction")
    if name not in _MODULES:
        raise AttributeError(f"module 'traction' has no attribute '{name}'")
    return getattr(import_module(f"traction.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
