"""Read one damaged input in an empty folder and report its effects."""

import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import TractionError
from tests.corpus.readers import READERS


@dataclass(frozen=True, slots=True)
class InputVerdict:
    """Effects of reading an input.

    Attributes:
        error: kind and text of the error; empty if the input was read.
        is_refused: whether the error is a `TractionError`.
        seconds: CPU time.
        strays: files written outside the folder.
    """

    error: str
    is_refused: bool
    seconds: float
    strays: tuple[str, ...]

    @property
    def is_sound(self) -> bool:
        """Whether the input was read or refused without writing outside the folder."""
        return (not self.error or self.is_refused) and not self.strays


def read_input(name: str, data: bytes) -> InputVerdict:
    """Read `data` with the reader `name` in its own folder."""
    with tempfile.TemporaryDirectory(prefix="corpus-") as scratch:
        outside = Path(scratch)
        folder = outside / "deep" / "down" / "here"
        folder.mkdir(parents=True)
        before = Path.cwd()
        os.chdir(folder)
        start = time.process_time()
        error, is_refused = "", True
        try:
            READERS[name](data, folder)
        except TractionError as refusal:
            error = str(refusal)
        except Exception as bug:
            error, is_refused = repr(bug), False
        finally:
            os.chdir(before)
        seconds = time.process_time() - start
        files = {path for path in outside.rglob("*") if path.is_file()}
        strays = [path for path in files if folder not in path.parents]
    return InputVerdict(error, is_refused, seconds, tuple(map(str, sorted(strays))))
