"""Recordings as standard ROS 2 topics, one message a cycle.

A recording has them as views at 50 Hz beside `/cycle`, which says all of it at 500 Hz;
they are made again from there, so that a recording need not hold everything twice.
"""

from collections.abc import Generator, Sequence
from pathlib import Path

import numpy as np

from acquisition.cdr import encode_string
from acquisition.errors import SessionError
from acquisition.trial_file.bag import BagMessage, bag_bytes
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.views import VIEW_TOPICS, encode_views
from experiments.export.checksums import SUMS, digest_of, write_sums
from experiments.export.trial_tables import make_empty
from experiments.operator.console import WARNING, Console
from experiments.session.data_files import write_new
from experiments.session.store import SessionFolder

_DESCRIPTION, _URDF = "/robot_description", "robot.urdf"
STANDARD_TOPICS = {_DESCRIPTION: "std_msgs/msg/String", **VIEW_TOPICS}
RECORDING = "recording"  # metadata record: that of the trial, and its SHA-256


def export_standard_topics(
    sessions: Sequence[SessionFolder], to: Path, console: Console
) -> None:
    """Write the kept trials of `sessions` below `to`, which must be empty.

    Per trial an MCAP file of `STANDARD_TOPICS` at the recorded rate, which programs
    without traction_msgs play, and checksums. Metadata and attachments are those of
    the recording.

    Args:
        sessions: their kept trials are written.
        to: the folder.
        console: what is written is named there.

    Raises:
        SessionError: `to` holds something, or no session has a kept trial.
        TrialFileError: a trial cannot be read, or a file cannot be written.
    """
    paths = [(session, path) for session in sessions for path in session.kept_trials()]
    if not paths:
        raise SessionError(f"{', '.join(s.id for s in sessions)}: no kept trials.")
    make_empty(to)
    for session, path in paths:
        trial = TrialReader(path)
        (to / session.path.name).mkdir(exist_ok=True)
        write_new(to / session.path.name / path.name, standard_topics(trial))
        count = trial.topic_counts()["/cycle"]
        console.say(f"{session.path.name}/{path.name}: {count} messages a topic")
    write_sums(to)
    if any(session.is_simulated for session, _ in paths):
        console.say(f"{WARNING} SIMULATED: metadata `{RECORDING}` of every file says.")
    check = f"cd {to} && sha256sum -c {SUMS}"
    console.say(f"{len(paths)} trials in {to}. To check: {check}")


def standard_topics(trial: TrialReader) -> bytes:
    """Return the MCAP file of the standard topics of a trial."""
    about = {**trial.metadata["trial"], "sha256": digest_of(trial.path)}
    metadata = {RECORDING: about, "clock": trial.metadata.get("clock", {})}
    return bag_bytes(STANDARD_TOPICS, _messages(trial), metadata, trial.attachments)


def _messages(trial: TrialReader) -> Generator[BagMessage]:
    rows = trial.cycles()
    if not len(rows.data):
        return
    times = rows.log_time.astype(np.int64)
    arm = rows.data["arm_ns"].astype(np.int64)
    offset = times - rows.data["host_ns"].astype(np.int64)
    published = np.where(arm > 0, arm + offset, times)
    if _URDF in trial.attachments:
        urdf = trial.attachments[_URDF].decode(errors="replace")
        yield BagMessage(_DESCRIPTION, int(times[0]), encode_string(urdf))
    columns = (times.tolist(), published.tolist(), rows.sequence.tolist())
    for record, time, sent, number in zip(rows.data, *columns, strict=True):
        for topic, data in encode_views(record, time).items():
            yield BagMessage(topic, time, data, sent, number)
