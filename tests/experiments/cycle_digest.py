"""Digests of the cycles that one seed of the simulation records.

`python -m tests.experiments.cycle_digest` writes them anew after a change that is meant
to alter the simulation, the control law or the layout of a cycle; with the name of a
folder it records there and prints them.
"""

import hashlib
import json
import sys
import tempfile
from pathlib import Path

from mcap.reader import make_reader
from threadpoolctl import threadpool_info

from tests.experiments.program import only_session, traction, write_config

KEPT = Path(__file__).parents[1] / "data" / "recorded" / "cycles.json"
TRAVEL = 0.055  # m, crossed in seconds
TRIALS = ("T01", "T02")


def processor() -> str:
    """Return what the linear algebra library takes this processor for.

    Its kernels round differently on another one, so digests hold for one kind.
    """
    import numpy as np

    np.dot(np.eye(2), np.eye(2))
    kinds = {library.get("architecture") for library in threadpool_info()} - {None}
    return "+".join(sorted(kinds))


def digest_of(path: Path) -> str:
    """Return the SHA-256 of every /cycle payload of a trial file, in order."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["/cycle"]):
            digest.update(message.data)
    return digest.hexdigest()


def digests_of(session: Path) -> dict[str, str]:
    """Return the digest of every trial of a session folder."""
    return {name: digest_of(session / "trials" / f"{name}.mcap") for name in TRIALS}


def record(folder: Path) -> Path:
    """Record the session whose digests are kept; return its folder."""
    config = write_config(folder, travel=TRAVEL)
    script = folder / "script"
    script.write_text("keep\nlast\nkeep\n")
    options = ("--fake", "--fast", "--trials", 3, "--seed", 5)
    paths = ("--config", config, "--data", folder, "--operator-script", script)
    traction("run", "TF", *options, *paths)
    return only_session(folder)


def main() -> None:
    """Write the digests of this machine's simulation, or tell them."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(temporary)
        found = {"processor": processor(), "digests": digests_of(record(folder))}
    if len(sys.argv) > 1:
        sys.stdout.write(json.dumps(found) + "\n")
    else:
        KEPT.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
