"""Is the program faster than it was? Whole commands of two commits, in turn.

    python -m benchmarks.beside_commit COMMIT

COMMIT is checked out into a folder of its own, which is removed afterwards. Both run in
this interpreter, each with data of its own, in turn, so that a busy machine slows both.
Times of an earlier machine say nothing here; how many times faster a command is, does.
A command may do more than it did: simulated sessions last longer than in early commits.
Takes a quarter of an hour; libraries that the commit needs are those installed here.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from benchmarks.whole_programs import TRIALS, spent

ROOT = Path(__file__).parents[1]
_AUTOMATIC = ("--fake", "--fast", "--operator-script", "auto")


@dataclass(frozen=True, slots=True)
class Command:
    """A command of the program, and how often it is measured.

    Attributes:
        what: it does, in words.
        arguments: of it; DATA stands for the folder of the data.
        times: it is repeated; the median counts.
    """

    what: str
    arguments: tuple[str, ...]
    times: int = 1

    def inside(self, data: Path) -> list[str]:
        """Return the command line for a folder of data."""
        given = [text.replace("DATA", str(data)) for text in self.arguments]
        return [sys.executable, "-m", "experiments", *given]


COMMANDS = (
    Command("status of an empty folder", ("status", "--data", "DATA"), 5),
    Command("session of ten, S0", ("run", "S0", *_AUTOMATIC, "--data", "DATA")),
    Command("session of ten, TF", ("run", "TF", *_AUTOMATIC, "--data", "DATA")),
    Command("report of both", ("report", "--all", "--data", "DATA")),
    Command("the same report again", ("report", "--all", "--data", "DATA"), 3),
    Command("80 external trials, fits and page", ("fit", str(TRIALS), "--out", "DATA")),
)


@contextmanager
def checked_out(commit: str, place: Path) -> Iterator[Path]:
    """Give a folder with the files of a commit."""
    git = ("git", "-C", str(ROOT), "worktree")
    tree = place / "tree"
    subprocess.run((*git, "add", "--quiet", "--detach", tree, commit), check=True)
    try:
        yield tree
    finally:
        subprocess.run((*git, "remove", "--force", tree), check=True)


def timed(command: Command, tree: Path, data: Path) -> tuple[float, float]:
    """Return processor and wall time of a command run in a tree [s].

    Raises:
        CalledProcessError: the command failed.
    """
    data.mkdir(parents=True, exist_ok=True)
    before, begin = spent(), time.perf_counter()
    subprocess.run(
        command.inside(data),
        cwd=tree,
        env=os.environ | {"PYTHONPATH": str(tree)},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    return spent() - before, time.perf_counter() - begin


def compared(command: Command, there: Path, place: Path) -> str:
    """Return a line of the table: both times of a command in turn, and their ratio."""
    folder = "fits" if command.arguments[0] == "fit" else "data"
    trees = {"then": there, "now": ROOT}
    took: dict[str, list[tuple[float, float]]] = {name: [] for name in trees}
    for _ in range(command.times):
        for name, tree in trees.items():
            took[name].append(timed(command, tree, place / name / folder))
    used = {k: statistics.median(one for one, _ in rows) for k, rows in took.items()}
    wall = {k: statistics.median(one for _, one in rows) for k, rows in took.items()}
    figures = (used["then"], used["now"], wall["then"], wall["now"])
    cells = [f"{used['then'] / used['now']:.1f}", *(f"{x:.2f}" for x in figures)]
    return f"| {command.what} | {' | '.join(cells)} |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("commit")
    wanted = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        with checked_out(wanted.commit, place) as there:
            print("| command | times less processor time | s then, now | | wall | |")
            print("|---|---|---|---|---|---|")
            for command in COMMANDS:
                if command.arguments[0] == "fit" and not TRIALS.exists():
                    continue
                print(compared(command, there, place), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
