"""Which pucks lost their position and were not zeroed since, kept on the disk."""

from collections.abc import Collection
from pathlib import Path

from acquisition.errors import PreflightError
from acquisition.files import open_directory, replace_file


class LostPositions:
    """What a start found out and the next one cannot see any more.

    A puck that was asleep counts from anywhere. Once it is woken nothing but the safety
    module's ZERO tells that, which any program on the bus may set.
    """

    def __init__(self, path: Path | None = None) -> None:
        """Keep it in the file `path`; None = in this object only."""
        self._path = path
        self._nodes: tuple[int, ...] = ()

    @property
    def is_noted(self) -> bool:
        """Whether positions were lost and not defined since."""
        return bool(self._nodes) or (self._path is not None and self._path.exists())

    def note(self, nodes: Collection[int]) -> None:
        """Note that pucks `nodes` lost their positions.

        Raises:
            PreflightError: the file cannot be written; nothing may be woken then.
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
        """Forget it: all positions are defined.

        Raises:
            PreflightError: the file cannot be taken away; the arm stays refused.
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
