"""The age of what carries a date: a date that has not come yet has none."""

from datetime import datetime, timedelta

CLOCK_STEP = timedelta(minutes=5)  # by which a computer's clock may be set back


def is_ahead(dated: datetime, now: datetime) -> bool:
    """Return whether a date has not come yet, beyond a step of the clock."""
    return dated - now > CLOCK_STEP


def is_fresh(dated: datetime, now: datetime, longest: timedelta) -> bool:
    """Return whether a date has come and is at most `longest` ago."""
    return now - dated <= longest and not is_ahead(dated, now)
