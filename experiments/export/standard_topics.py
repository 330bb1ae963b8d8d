"""Export of recordings as standard ROS 2 topics, one message per cycle.

A recording has these topics only as views at 50 Hz, along with `/cycle` at 500 Hz; the
export computes them from `/cycle` at the full rate.
"""

from collections.abc import Generator, Mapping, Sequence
from math import atan2, hypot
from pathlib import Path

import numpy as np

from acquisition.cdr import encode_string
from acquisition.errors import SessionError, SettingsError
from acquisition.trial_file.bag import BagMessage, bag_bytes
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.views import VIEW_TOPICS, encode_views
from acquisition.wording import counted
from analysis.data.load import sensor_height_of
from experiments.export.checksums import SUMS, digest_of, write_sums
from experiments.operator.console import WARNING, Console
from experiments.session.data_files import make_empty, write_new
from experiments.session.store import SessionFolder
from ft_sensor.calibration.files import payload_from_toml

_DESCRIPTION, _URDF = "/robot_description", "robot.urdf"
_CALIBRATION = "ft_calibration.toml"
STANDARD_TOPICS = {_DESCRIPTION: "std_msgs/msg/String", **VIEW_TOPICS}
RECORDING = "recording"  # metadata record of the trial, with its SHA-256


def export_standard_topics(
    sessions: Sequence[SessionFolder], to: Path, console: Console
) -> None:
    """Write the kept trials of `sessions` to the empty folder `to`.

    Per trial an MCAP file of `STANDARD_TOPICS` at the recorded rate, which programs
    without traction_msgs can play, and checksums. Metadata and attachments are those of
    the recording.

    Args:
        sessions: the sessions.
        to: the folder.
        console: output of the written files.

    Raises:
        SessionError: `to` is not empty, or no session has a kept trial.
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
    console.say(f"{counted(len(paths), 'trial')} in {to}. To check: {check}")


def standard_topics(trial: TrialReader) -> bytes:
    """Return the MCAP file of the standard topics of a trial."""
    about = {**trial.metadata["trial"], "sha256": digest_of(trial.path)}
    metadata = {RECORDING: about, "clock": trial.metadata.get("clock", {})}
    return bag_bytes(STANDARD_TOPICS, _messages(trial), metadata, trial.attachments)


def description(attachments: Mapping[str, bytes]) -> str:
    """Return the arm's URDF with the frames `ft_sensor` and `sole` of a recording.

    Without these frames if the calibration or the sensor's height is not recorded.
    """
    urdf = attachments[_URDF].decode(errors="replace")
    height = sensor_height_of(attachments.get("config.toml", b""))
    calibration = attachments.get(_CALIBRATION, b"").decode(errors="replace")
    try:
        payload, sole = payload_from_toml(calibration)
    except SettingsError:
        return urdf
    if height is None:
        return urdf
    (r00, _, _), (r10, _, _), (r20, r21, r22) = payload.rotation.tolist()
    turn = atan2(r21, r22), atan2(-r20, hypot(r21, r22)), atan2(r10, r00)  # rpy
    frames = _fixed("ft_sensor", (0.0, 0.0, height), turn)
    frames += _fixed("sole", sole.tolist(), (0.0, 0.0, 0.0))
    return urdf.replace("</robot>", f"{frames}</robot>")


def _fixed(link: str, xyz: Sequence[float], rpy: Sequence[float]) -> str:
    at, turn = (" ".join(map(repr, numbers)) for numbers in (xyz, rpy))
    return (
        f'  <link name="{link}"/>\n'
        f'  <joint name="{link}_mount" type="fixed">\n'
        f'    <parent link="wam_tool"/><child link="{link}"/>\n'
        f'    <origin xyz="{at}" rpy="{turn}"/>\n'
        "  </joint>\n"
    )


def _messages(trial: TrialReader) -> Generator[BagMessage]:
    rows = trial.cycles()
    if not len(rows.data):
        return
    times = rows.log_time.astype(np.int64)
    arm = rows.data["arm_ns"].astype(np.int64)
    offset = times - rows.data["host_ns"].astype(np.int64)
    published = np.where(arm > 0, arm + offset, times)
    if _URDF in trial.attachments:
        urdf = encode_string(description(trial.attachments))
        yield BagMessage(_DESCRIPTION, int(times[0]), urdf)
    columns = (times.tolist(), published.tolist(), rows.sequence.tolist())
    for record, time, sent, number in zip(rows.data, *columns, strict=True):
        for topic, data in encode_views(record, time).items():
            yield BagMessage(topic, time, data, sent, number)
