"""What a log and a URDF hold: the first thing to look at before an import."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.logs.channels import stamp_of, wrench_fields
from analysis.logs.log_file import LogTopic
from analysis.logs.opening import open_log
from analysis.logs.robot import read_urdf

_NS = 1e-9
_MOST = 200  # topics and names that are shown


class _Times(NamedTuple):
    stamps: array[int]
    received: array[int]


def listing(path: Path, urdf: Path | None) -> Iterator[str]:
    """Yield topics, types, counts, rates and frames of a log, and the robot's links.

    Raises:
        SettingsError: a file is missing, or no log or URDF.
    """
    with open_log(path) as log:
        times = {name: _Times(array("q"), array("q")) for name in log.topics}
        frames: dict[str, str] = {}
        for message in log.messages(log.topics):
            topic, each = log.topics[message.topic], times[message.topic]
            stamp_ns, frame = stamp_of(topic, message.data)
            frames.setdefault(message.topic, frame)
            each.stamps.append(stamp_ns)
            each.received.append(message.received_ns)
        yield f"{path}: {log.format}, {len(log.topics)} topics"
        for name, topic in list(log.topics.items())[:_MOST]:
            yield _line(topic, times[name], frames.get(name, ""))
        for name, about in list(log.unread.items())[:_MOST]:
            yield f"  {name}  {about}: not read"
        yield from (f"▲ {loss}" for loss in log.losses)
    if urdf is not None:
        robot = read_urdf(urdf)
        yield f"{urdf}: {robot.name or 'a robot'}"
        yield f"  links: {', '.join(robot.links[:_MOST])}"
        moving = robot.joint_names[:_MOST]
        yield f"  joints that move: {', '.join(moving) or 'none'}"


def _line(topic: LogTopic, times: _Times, frame: str) -> str:
    """Return a topic in one line."""
    parts = [f"  {topic.name}  {topic.type_name}  {len(times.received)} messages"]
    stamps = np.array(times.stamps, np.int64)
    by_stamp, by_receipt = _rate(stamps), _rate(np.array(times.received, np.int64))
    if by_stamp is not None and stamps.min() > 0:
        parts.append(f"{by_stamp:.1f} Hz by stamp")
    if by_receipt is not None:
        parts.append(f"{by_receipt:.1f} Hz by receipt")
    if frame:
        parts.append(f"frame {frame[:60]}")
    fields = [".".join(f.path) for f in wrench_fields(topic) if f.path]
    if fields:
        parts.append(f"wrench in {', '.join(fields[:5])}")
    return ", ".join(parts)


def _rate(times: NDArray[np.int64]) -> float | None:
    """Return messages a second by the median step of sorted times [Hz]."""
    steps = np.diff(np.sort(times))
    steps = steps[steps > 0]
    return None if not steps.size else 1.0 / (float(np.median(steps)) * _NS)
