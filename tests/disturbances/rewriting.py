"""Rewrite a recorded trial with other cycles or attachments."""

from collections.abc import Mapping
from pathlib import Path

from acquisition.recording.recorder import seal
from acquisition.sample import Record
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.writer import TrialHeader, TrialWriter


def rewrite(
    source: Path,
    path: Path,
    cycles: Record,
    attachments: Mapping[str, bytes] | None = None,
    stated: Mapping[str, str] | None = None,
) -> Path:
    """Write `cycles` with the metadata and attachments of another trial.

    Args:
        source: the other trial.
        path: file to write.
        cycles: cycles of the new trial.
        attachments: replacements of the other trial's attachments.
        stated: replacements of the other trial's metadata.
    """
    reader = TrialReader(source)
    clock = reader.metadata["clock"]
    trial = {k: v for k, v in reader.metadata["trial"].items() if k != "format_version"}
    header = TrialHeader(
        trial={**trial, **(stated or {})},
        utc_offset_ns=int(clock["utc_offset_ns"]),
        offset_uncertainty_ns=int(clock["offset_uncertainty_ns"]),
        provenance={},
        attachments={**reader.attachments, **(attachments or {})},
        robot_description="",
    )
    writer = TrialWriter(path, header)
    writer.write_cycles(cycles)
    seal(writer, "key")
    return path
