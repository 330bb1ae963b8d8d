"""Digests of the cycles that one seed of the simulation records.

`python -m tests.experiments.cycle_digest` rewrites them after a change that is meant
to alter the simulation, the control law or the layout of a cycle; with the name of a
folder it records there and prints them.
"""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from threadpoolctl import threadpool_info

from acquisition.linear_algebra import ONE_THREAD
from tests.experiments.program import only_session, traction, write_config

KEPT = Path(__file__).parents[1] / "data" / "recorded" / "cycles.json"
TRAVEL = 0.055  # m, crossed in seconds
TRIALS = ("T01", "T02")
# kernels that every processor of the last ten years has: digests hold on all of them
SETTINGS = ONE_THREAD | {"OPENBLAS_CORETYPE": "Haswell"}


def processor() -> str:
    """Processor whose kernels the linear algebra library uses.

    Kernels of another processor round differently, so digests hold for one kind.
    """
    import numpy as np

    np.dot(np.eye(2), np.eye(2))
    kinds = {library.get("architecture") for library in threadpool_info()} - {None}
    return "+".join(sorted(kinds))


def digest_of(path: Path) -> str:
    """SHA-256 of all /cycle payloads of a trial file, in order."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["/cycle"]):
            digest.update(message.data)
    return digest.hexdigest()


def digests_of(session: Path) -> dict[str, str]:
    """Digest of every trial of a session folder."""
    return {name: digest_of(session / "trials" / f"{name}.mcap") for name in TRIALS}


def record(folder: Path) -> Path:
    """Record the session whose digests are kept; its folder."""
    config = write_config(folder, travel=TRAVEL)
    script = folder / "script"
    script.write_text("keep\nlast\nkeep\n")
    options = ("--fake", "--fast", "--trials", 3, "--seed", 5)
    paths = ("--config", config, "--data", folder, "--operator-script", script)
    traction("run", "TF", *options, *paths)
    return only_session(folder)


def main() -> None:
    """Rewrite the digests of the simulation, or print those of this process."""
    if len(sys.argv) > 1:
        result = {
            "processor": processor(),
            "digests": digests_of(record(Path(sys.argv[1]))),
        }
        sys.stdout.write(json.dumps(result) + "\n")
        return
    with tempfile.TemporaryDirectory() as folder:
        KEPT.write_text(json.dumps(digests_in_process(Path(folder)), indent=1) + "\n")


def digests_in_process(folder: Path) -> dict[str, Any]:
    """Processor and digests of a recording in a process with the fixed kernels."""
    command = [sys.executable, "-m", "tests.experiments.cycle_digest", folder]
    environment = os.environ | SETTINGS
    done = subprocess.run(command, env=environment, capture_output=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
