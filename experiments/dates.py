"""Age of dated files and records; dates in the future have none."""

from datetime import datetime, timedelta

CLOCK_STEP = timedelta(minutes=5)  # largest backward step of a computer's clock


def is_ahead(dated: datetime, now: datetime) -> bool:
    """Return whether a date is in the future, beyond a step of the clock."""
    return dated - now > CLOCK_STEP


def is_fresh(dated: datetime, now: datetime, longest: timedelta) -> bool:
    """Return whether a date is in the past and at most `longest` ago."""
    return now - dated <= longest and not is_ahead(dated, now)
