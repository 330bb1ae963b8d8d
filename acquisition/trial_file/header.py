"""Header of a trial file, and the writer's counters."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from acquisition.clock import RATE_HZ

_DIGEST = "sha256:"  # prefix of the attachments' keys in the provenance


@dataclass(frozen=True, slots=True)
class TrialHeader:
    """Data of a trial known before the first cycle.

    Attributes:
        trial: metadata `trial` (session, terrain, operator, ...), strings.
        utc_offset_ns: UTC = monotonic + offset, constant in the file [ns].
        offset_uncertainty_ns: uncertainty of the offset [ns].
        rate_hz: nominal rate of the loop.
        provenance: software, machine and device identities, strings.
        attachments: contents by file name, e.g. `config.toml`.
        robot_description: URDF of the arm.
        views_every: period of the 50 Hz views in cycles, 0 = none.
        has_frames: raw frames of the bus are recorded, too.
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
    """Counters of the data written so far."""

    cycles: int = 0
    missed: int = 0
    late: int = 0
    lost_in_ring: int = 0
    first_cycle: int | None = None
    last_cycle: int | None = None
    messages: dict[str, int] = field(default_factory=dict[str, int])


def digest_fields(digests: Mapping[str, str]) -> dict[str, str]:
    """Return SHA-256 digests of attachments as fields of metadata `provenance`."""
    return {f"{_DIGEST}{name}": digest for name, digest in digests.items()}


def attachment_digests(provenance: Mapping[str, str]) -> dict[str, str]:
    """Return the SHA-256 digests of the attachments by name."""
    return {
        key.removeprefix(_DIGEST): digest
        for key, digest in provenance.items()
        if key.startswith(_DIGEST)
    }
