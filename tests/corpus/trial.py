"""One hostile input, read in an empty folder: what it did."""

import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import TractionError
from tests.corpus.readers import READERS


@dataclass(frozen=True, slots=True)
class GuardVerdict:
    """What became of an input.

    Attributes:
        error: of what kind, and what it says; empty where it was read.
        is_refused: the error is one that a person can act on.
        seconds: of CPU.
        strays: files that appeared outside of the folder.
    """

    error: str
    is_refused: bool
    seconds: float
    strays: tuple[str, ...]

    @property
    def is_sound(self) -> bool:
        """Whether it was read or refused, and nothing else happened."""
        return (not self.error or self.is_refused) and not self.strays


def read(name: str, data: bytes) -> GuardVerdict:
    """Read `data` by the reader `name` in a folder of its own."""
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
        found = {path for path in outside.rglob("*") if path.is_file()}
        strays = [path for path in found if folder not in path.parents]
    return GuardVerdict(error, is_refused, seconds, tuple(map(str, sorted(strays))))
