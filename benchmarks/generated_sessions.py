"""Generate complete session folders quickly, as input for `scale`.

Journal, session.json and sidecars are as the program writes them. By default, the
recordings are a few kilobytes of noise, since `status` reads only their checksums.
"""

import hashlib
import json
import random
from collections.abc import Callable
from pathlib import Path

from experiments.session.data_files import journal_line
from experiments.session.states import Event

TERRAINS = ("S0", "S10", "S15", "B0", "B10", "B15", "TF", "Tf")
_UTC = "2027-01-15T10:00:00Z"


def make_sessions(
    data: Path,
    count: int,
    *,
    trials: int = 10,
    size: int = 4096,
    terrain: str | None = None,
    record: Callable[[Path], None] | None = None,
) -> list[Path]:
    """Write complete sessions below `data` and return their folders.

    Args:
        data: a data folder without sessions.
        count: number of sessions.
        trials: kept trials per session.
        size: size of a noise recording [bytes].
        terrain: terrain of all sessions; None = all terrains in turn.
        record: writes the recording of a trial to a path; None = noise.
    """
    folders: list[Path] = []
    for number in range(1, count + 1):
        name = terrain or TERRAINS[number % len(TERRAINS)]
        folders.append(data / "sessions" / f"2027-01-15_S{number:03d}_{name}.fake")
        noise = random.Random(number)

        def write_noise(path: Path, noise: random.Random = noise) -> None:
            path.write_bytes(noise.randbytes(size))

        _make_session(folders[-1], name, trials, record or write_noise)
    return folders


def _make_session(
    folder: Path, terrain: str, trials: int, record: Callable[[Path], None]
) -> None:
    for name in ("trials", "rejected", "faults"):
        (folder / name).mkdir(parents=True)
    events: list[dict[str, object]] = [
        {"event": Event.STARTED, "terrain": terrain, "trials": trials},
        {"event": Event.ACTIVATED},
    ]
    for number in range(1, trials + 1):
        stem = folder / "trials" / f"T{number:02d}"
        recording = stem.with_suffix(".mcap")
        record(recording)
        digest = hashlib.sha256(recording.read_bytes()).hexdigest()
        sums = {"sha256": digest, "size": recording.stat().st_size}
        trial = {"trial": number, "attempt": 1}
        events += [
            {"event": Event.TRIAL_STARTED, **trial},
            {"event": Event.TRIAL_RECORDED, **trial, "recording": sums},
            {"event": Event.TRIAL_KEPT, **trial, **sums},
        ]
        sidecar = {"trial": stem.name, "attempt": 1, "verdict": "keep", **sums}
        stem.with_suffix(".json").write_text(json.dumps(sidecar))
    events.append({"event": Event.ENDED, "reason": "complete"})
    lines = [
        journal_line({**event, "utc": _UTC}, number)
        for number, event in enumerate(events, 1)
    ]
    (folder / "events.jsonl").write_bytes(b"".join(lines))
    summary = {"id": folder.name.split("_")[1], "phase": "complete", "operator": "made"}
    (folder / "session.json").write_text(json.dumps(summary))
    (folder / ".lock").write_text("{}")
