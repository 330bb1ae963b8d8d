"""Record on disk of pucks that lost their position and were not zeroed since."""

from collections.abc import Collection
from pathlib import Path

from acquisition.errors import PreflightError
from acquisition.files import open_directory, replace_file


class LostPositions:
    """Record of lost positions that outlives the program.

    A puck that was asleep has an arbitrary position. Once it is awake, only the safety
    module's ZERO shows that, which any program on the bus may set.
    """

    def __init__(self, path: Path | None = None) -> None:
        """Keep the record in the file `path`; None = in memory only."""
        self._path = path
        self._nodes: tuple[int, ...] = ()

    @property
    def is_noted(self) -> bool:
        """Whether positions were lost and not redefined since."""
        return bool(self._nodes) or (self._path is not None and self._path.exists())

    def note(self, nodes: Collection[int]) -> None:
        """Record that pucks `nodes` lost their positions.

        Raises:
            PreflightError: the file cannot be written; then no puck may be woken.
        """
        self._nodes = tuple(nodes)
        if self._path is None:
            return
        try:
            names = " ".join(map(str, nodes))
            line = f"Pucks asleep at a start, not zeroed since: {names}\n"
            with open_directory(self._path.parent) as folder:
                replace_file(folder, self._path.name, line.encode())
        except OSError as error:
            raise PreflightError(
                "Pucks lost their positions, and that cannot be noted in "
                f"{self._path}: {error.strerror or error}.",
                hint="Make the folder of rig.toml writable, then start again.",
            ) from error

    def clear(self) -> None:
        """Clear the record: all positions are defined.

        Raises:
            PreflightError: the file cannot be removed; the arm stays refused.
        """
        if self._path is not None:
            try:
                self._path.unlink(missing_ok=True)
            except OSError as error:
                raise PreflightError(
                    "The positions are defined, but what notes that they were lost "
                    f"cannot be removed: {self._path}: {error.strerror or error}.",
                    hint="Make the folder of rig.toml writable, then: traction zero.",
                ) from error
        self._nodes = ()
