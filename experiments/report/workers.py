"""Workers for fits and figures, which import while this process reads trials."""

from collections.abc import Generator
from contextlib import contextmanager

from analysis.study.worker_processes import end_workers, warm_workers

_NEEDED = (  # modules of fits and figures, in order of use
    "analysis.study.study",
    "analysis.report.page",
    "matplotlib.figure",
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
)


@contextmanager
def workers_of_report(*, are_needed: bool) -> Generator[None]:
    """Context of the workers, started before anything else and ended with the block.

    Args:
        are_needed: whether there is certainly work; otherwise they are started on
            demand.
    """
    try:
        if are_needed:
            warm_workers(_NEEDED)
        yield
    finally:
        end_workers()
