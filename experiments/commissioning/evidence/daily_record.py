"""daily.json: what the short check of every day measured, day after day.

It is compared with the commissioning of the same arm; what drifts is seen before it
fails.
"""

import json
from datetime import datetime, timedelta
from pathlib import Path
from typing import Literal, Self

from acquisition.errors import SettingsError
from acquisition.files import open_directory, read_regular, replace_file
from acquisition.formats import FORMAT
from acquisition.validation import Many, first_problem
from experiments.commissioning.evidence.record import Measured, Raw, RecordPart, Word
from experiments.dates import is_fresh

NAME = "daily.json"
FIELD = "daily_check"  # of the metadata of a recording
_LARGEST = 16_000_000  # bytes
_KEPT = 2000  # checks; older ones go
COUNTS_FOR = timedelta(hours=16)  # a day in the laboratory
_HINT = "Put back the file as it was written, or move it away: its history begins anew."


class DailyCheck(RecordPart):
    """One check.

    Attributes:
        started: UTC.
        ended: UTC.
        operator: who did it.
        raw: what was recorded.
        quantities: what came of it, with its limits.
        cause: the first contradiction, in words; "" = none.
    """

    started: datetime
    ended: datetime
    operator: Word
    raw: Raw
    quantities: Many[Measured]
    cause: Word = ""

    @property
    def words(self) -> str:
        """When it was done and what came of it."""
        when = f"{self.ended:%Y-%m-%d %H:%M} UTC"
        return f"{when}, {self.cause or 'sound'}"


class DailyHistory(RecordPart):
    """All checks of an arm, the oldest first.

    Attributes:
        version: of the file.
        is_simulated: the arm is.
        checks: what was done.
    """

    version: Literal["1.0"] = FORMAT
    is_simulated: bool = False
    checks: Many[DailyCheck] = ()

    def with_check(self, check: DailyCheck) -> Self:
        """Return it with a check at its end."""
        return self.model_copy(update={"checks": (*self.checks, check)[-_KEPT:]})

    def counts_at(self, now: datetime) -> bool:
        """Return whether the last check has come and was done at most a day ago."""
        return bool(self.checks) and is_fresh(self.checks[-1].ended, now, COUNTS_FOR)


def read_history(folder: Path, *, is_simulated: bool) -> DailyHistory:
    """Return what stands in `folder`, or an empty history.

    Args:
        folder: of commissioning.json.
        is_simulated: the arm is; the history of the other kind is none of this arm.

    Raises:
        SettingsError: it cannot be read, or is no such file.
    """
    path = folder / NAME
    try:
        history = DailyHistory.model_validate_json(read_regular(path, _LARGEST))
    except FileNotFoundError:
        return DailyHistory(is_simulated=is_simulated)
    except OSError as error:
        raise _unreadable(path, error.strerror or str(error)) from error
    except ValueError as error:
        raise _unreadable(path, first_problem(error)) from error
    if history.is_simulated is not is_simulated:
        return DailyHistory(is_simulated=is_simulated)
    return history


def _unreadable(path: Path, why: str) -> SettingsError:
    return SettingsError(f"{path} cannot be read: {why}.", hint=_HINT)


def write_history(folder: Path, history: DailyHistory) -> None:
    """Write it whole, or leave the earlier one.

    Raises:
        OSError: it cannot be written.
    """
    text = json.dumps(history.model_dump(mode="json"), indent=1) + "\n"
    with open_directory(folder) as directory:
        replace_file(directory, NAME, text.encode())
