"""What a trial file is made with, and what the writer counts."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from acquisition.clock import RATE_HZ

_DIGEST = "sha256:"  # begins the keys of attachments in the provenance


@dataclass(frozen=True, slots=True)
class TrialHeader:
    """What is known before the first cycle.

    Attributes:
        trial: metadata `trial` (session, terrain, operator, ...), strings.
        utc_offset_ns: UTC = monotonic + this, one number for the whole file [ns].
        offset_uncertainty_ns: half width of the reading that gave it [ns].
        rate_hz: nominal rate of the loop.
        provenance: software, machine and device identities, strings.
        attachments: file name to content, e.g. `config.toml`.
        robot_description: URDF of the arm.
        views_every: every how many cycles the 50 Hz views are written, 0 = never.
        has_frames: the raw frames of the bus are recorded too.
    """

    trial: Mapping[str, str]
    utc_offset_ns: int
    offset_uncertainty_ns: int
    provenance: Mapping[str, str]
    attachments: Mapping[str, bytes]
    robot_description: str
    rate_hz: int = RATE_HZ
    views_every: int = 10
    has_frames: bool = False


@dataclass(slots=True)
class WriterCounts:
    """What the writer has put into the file so far."""

    cycles: int = 0
    missed: int = 0
    late: int = 0
    lost_in_ring: int = 0
    first_cycle: int | None = None
    last_cycle: int | None = None
    messages: dict[str, int] = field(default_factory=dict[str, int])


def digest_fields(digests: Mapping[str, str]) -> dict[str, str]:
    """Return SHA-256 digests of attachments by name as metadata `provenance`."""
    return {f"{_DIGEST}{name}": digest for name, digest in digests.items()}


def attachment_digests(provenance: Mapping[str, str]) -> dict[str, str]:
    """Return which attachments were written: their SHA-256 digests by name."""
    return {
        key.removeprefix(_DIGEST): digest
        for key, digest in provenance.items()
        if key.startswith(_DIGEST)
    }
