"""Verification of a finished file against the writer's counters."""

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.clock import PERIOD_NS
from acquisition.errors import TrialFileError
from acquisition.trial_file.contents import as_trial_file_error
from acquisition.trial_file.data_files import open_data
from acquisition.trial_file.header import WriterCounts, attachment_digests
from acquisition.trial_file.reader import TopicRows, TrialReader

PERIOD_TOLERANCE = 0.02
REQUIRED_METADATA = ("trial", "clock", "provenance", "channels", "result")


@dataclass(frozen=True, slots=True)
class VerifiedFile:
    """Result of verifying a file.

    Attributes:
        sha256: hex digest of the file.
        size: size [bytes].
        cycles: records of `/cycle`, 0 for a truth file.
        duration: time from first to last cycle [s].
        worst_gap: longest time between two cycles [s].
        is_complete: the recording was ended properly; False for a recovered file.
    """

    sha256: str
    size: int
    cycles: int
    duration: float
    worst_gap: float
    is_complete: bool


def verify_file(path: Path, counts: WriterCounts | None = None) -> VerifiedFile:
    """Check magics, CRCs, counts, cadence, clock and attachments of `path`.

    A recovered file may lack attachments, and its cadence is not checked.

    Args:
        path: finished trial file, `.partial` or published.
        counts: counters of the writer, if available.

    Raises:
        TrialFileError: a check fails.
    """
    reader = TrialReader(path)
    missing = [name for name in REQUIRED_METADATA if name not in reader.metadata]
    if missing:
        raise TrialFileError(path, f"lacks metadata {', '.join(missing)}")
    _check_attachments(reader)
    actual = {topic: count for topic, count in reader.topic_counts().items() if count}
    if counts is not None and actual != counts.messages:
        raise TrialFileError(path, "holds other messages than were written")
    with as_trial_file_error(path):
        cycles, duration, worst = _check_cycles(reader)
        with os.fdopen(open_data(path), "rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    return VerifiedFile(
        digest, reader.size, cycles, duration, worst, reader.is_complete
    )


def _check_attachments(reader: TrialReader) -> None:
    for name, digest in attachment_digests(reader.metadata["provenance"]).items():
        actual = reader.attachments.get(name)
        if actual is None and not reader.is_complete:
            continue
        if actual is None or hashlib.sha256(actual).hexdigest() != digest:
            raise TrialFileError(reader.path, f"has no sound attachment {name}")


def _check_cycles(reader: TrialReader) -> tuple[int, float, float]:
    """Return (cycles, duration [s], worst gap [s])."""
    if "/cycle" not in reader.topic_counts():
        return 0, 0.0, 0.0
    rows = reader.cycles()
    numbers = rows.data["cycle"].astype(np.int64)
    host_ns = rows.data["host_ns"].astype(np.int64)
    _check_numbers(reader, numbers)
    _check_clock(reader, rows, host_ns)
    if len(numbers) < 2:
        if reader.is_complete:
            raise TrialFileError(reader.path, "holds fewer than two cycles")
        return len(numbers), 0.0, 0.0
    gaps = np.diff(host_ns)
    if reader.is_complete:
        _check_cadence(reader, gaps / np.diff(numbers))
    duration = float(host_ns[-1] - host_ns[0]) * 1e-9
    return len(numbers), duration, float(gaps.max()) * 1e-9


def _check_numbers(reader: TrialReader, numbers: NDArray[np.int64]) -> None:
    result = reader.metadata["result"]
    if len(numbers) != int(result["cycles_written"]):
        raise TrialFileError(reader.path, f"holds {len(numbers)} cycles, not as stated")
    steps = np.diff(numbers)
    if bool((steps < 1).any()):
        raise TrialFileError(reader.path, "has cycles out of order")
    if int((steps - 1).sum()) != int(result["cycles_missed"]):
        raise TrialFileError(reader.path, "lacks other cycles than it states")


def _check_clock(
    reader: TrialReader, rows: TopicRows, host_ns: NDArray[np.int64]
) -> None:
    offset = int(reader.metadata["clock"]["utc_offset_ns"])
    if bool((rows.log_time.astype(np.int64) - host_ns != offset).any()):
        raise TrialFileError(reader.path, "has times that do not follow its clock")


def _check_cadence(reader: TrialReader, periods_ns: NDArray[np.float64]) -> None:
    median = float(np.median(periods_ns))
    if abs(median - PERIOD_NS) > PERIOD_TOLERANCE * PERIOD_NS:
        raise TrialFileError(
            reader.path, f"has a median period of {median / 1e6:.3f} ms, not 2 ms"
        )
