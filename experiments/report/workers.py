"""Workers for fits and figures, which import while this process reads."""

from acquisition.worker_processes import available_cores, prepare_workers

_WORK = (  # what fits and figures need, the first needed first
    "analysis.study.break_away_fit",
    "analysis.study.study",
    "analysis.study.store",
    "analysis.terrains.tabulation",
    "analysis.report.page",
    "scipy.signal",
    "matplotlib.figure",
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
)


def start_workers(scheduler: str | None) -> None:
    """Start what workers are copied from: first of all that a command does.

    Args:
        scheduler: address of one that has workers of its own; None = none.
    """
    if scheduler is None and available_cores() > 1:
        prepare_workers(_WORK)
