"""Workers for fits and figures, which import while this process reads."""

from collections.abc import Generator
from contextlib import contextmanager

from analysis.study.worker_processes import end_workers, warm_workers

_NEEDED = (  # by fits and figures, the first needed first
    "analysis.study.study",
    "analysis.report.page",
    "scipy.signal",
    "matplotlib.figure",
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
)


@contextmanager
def workers_of_report(*, are_needed: bool) -> Generator[None]:
    """Start workers, first of all that a command does; end them with the block.

    Args:
        are_needed: there is work for them for certain; else they are started when
            there is.
    """
    try:
        if are_needed:
            warm_workers(_NEEDED)
        yield
    finally:
        end_workers()
