"""daily.json: history of the daily checks.

Each check is compared with the commissioning of the same arm, so that a drift shows
before a failure.
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
FIELD = "daily_check"  # in the metadata of a recording
_LARGEST = 16_000_000  # bytes
_KEPT = 2000  # checks; older ones are dropped
COUNTS_FOR = timedelta(hours=16)  # a day in the laboratory
_HINT = "Put back the file as it was written, or move it away: its history begins anew."


class DailyCheck(RecordPart):
    """One daily check.

    Attributes:
        started: UTC.
        ended: UTC.
        operator: name of the operator.
        raw: the recording.
        quantities: results with their limits.
        cause: the first contradiction; "" = none.
    """

    started: datetime
    ended: datetime
    operator: Word
    raw: Raw
    quantities: Many[Measured]
    cause: Word = ""

    @property
    def words(self) -> str:
        """Time and result."""
        when = f"{self.ended:%Y-%m-%d %H:%M} UTC"
        return f"{when}, {self.cause or 'sound'}"


class DailyHistory(RecordPart):
    """All daily checks of an arm, oldest first.

    Attributes:
        version: version of the file format.
        is_simulated: whether the arm is simulated.
        checks: the checks.
    """

    version: Literal["1.0"] = FORMAT
    is_simulated: bool = False
    checks: Many[DailyCheck] = ()

    def with_check(self, check: DailyCheck) -> Self:
        """Return the history with a check appended."""
        return self.model_copy(update={"checks": (*self.checks, check)[-_KEPT:]})

    def counts_at(self, now: datetime) -> bool:
        """Return whether the last check is at most `COUNTS_FOR` old, and not ahead."""
        return bool(self.checks) and is_fresh(self.checks[-1].ended, now, COUNTS_FOR)


def read_history(folder: Path, *, is_simulated: bool) -> DailyHistory:
    """Read the history in `folder`, or an empty one.

    Args:
        folder: folder of commissioning.json.
        is_simulated: whether the arm is simulated; a history of the other kind is
            ignored.

    Raises:
        SettingsError: the file cannot be read or is invalid.
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
    """Replace the history atomically.

    Raises:
        OSError: the file cannot be written.
    """
    text = json.dumps(history.model_dump(mode="json"), indent=1) + "\n"
    with open_directory(folder) as directory:
        replace_file(directory, NAME, text.encode())
