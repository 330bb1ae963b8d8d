"""Files written whole or not at all."""

import os
import tempfile
from pathlib import Path

from acquisition import SettingsError


def write_atomic(path: Path, content: bytes) -> None:
    """Write `content` to `path`: a reader sees the old file or the new, never a part.

    Missing folders are made.

    Raises:
        SettingsError: the folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        temporary = Path(name)
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            temporary.chmod(0o644)  # mkstemp makes it private
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise SettingsError(
            f"{path}: cannot be written ({error.strerror}).",
            hint="Name a folder that you may write to, with space left.",
        ) from error
