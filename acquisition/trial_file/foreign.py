"""Diagnosis of MCAP files of other programs given instead of a trial."""

from itertools import islice
from pathlib import Path

from mcap.records import Channel, Metadata

from acquisition.errors import TrialFileError
from acquisition.trial_file.contents import read_file
from acquisition.trial_file.records import MAGIC
from acquisition.trial_file.salvage import SoundRecords

_LOOKED_AT = 5_000  # records read; channels precede their messages
_NAMED = 4  # topics in one message
_LONGEST_TOPIC = 40  # characters


def foreign_reason(path: Path) -> str:
    """Return the reason why an MCAP file is not a trial, with its topics.

    Returns:
        "" for a damaged trial, and for other than MCAP files.
    """
    try:
        data = read_file(path)
    except TrialFileError:
        return ""
    if not data.startswith(MAGIC):
        return ""
    topics: list[str] = []
    for record in islice(SoundRecords(data, path), _LOOKED_AT):
        if isinstance(record, Metadata) and record.name == "trial":
            return ""
        if isinstance(record, Channel) and record.topic not in topics:
            topics.append(record.topic)
    if not topics or "/cycle" in topics:
        return ""
    topic_list = ", ".join(topic[:_LONGEST_TOPIC] for topic in topics[:_NAMED])
    remainder = f" and {len(topics) - _NAMED} more" if len(topics) > _NAMED else ""
    return f"is no trial of Traction: it holds topics {topic_list}{remainder}"
