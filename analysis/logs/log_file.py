"""Common interface of logs: topics, and their messages in file order."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, open_regular
from acquisition.trial_file.unpacking import Unpacker

LARGEST_LOG = 2 * 10**9  # bytes on disk
LARGEST_PART = 64 * 2**20  # bytes of a record or an unpacked chunk
LARGEST_RATIO = 100  # unpacked to packed size of a part
MOST_MESSAGES = 10**7  # per topic that is read
LONGEST_NAME = 4096  # bytes of a topic, type, frame or joint name
MOST_TOPICS = 5_000
_BLOCK = 2**20  # bytes copied at a time

Serialization = Literal["cdr", "ros1"]


@dataclass(frozen=True, slots=True)
class LogTopic:
    """One topic of a log.

    Attributes:
        name: name, e.g. /joint_states.
        type_name: package and type, e.g. sensor_msgs/JointState.
        serialization: serialisation of its messages.
    """

    name: str
    type_name: str
    serialization: Serialization


class LogMessage(NamedTuple):
    """One stored message.

    Attributes:
        topic: name of its topic.
        received_ns: time of receipt [UTC ns].
        data: serialised content.
    """

    topic: str
    received_ns: int
    data: bytes


class LogFile(Protocol):
    """A log of any format.

    Attributes:
        path: the file.
        format: format in words.
        topics: topics by name.
        losses: unreadable parts in words; complete once `messages` has ended.
        unread: types and encodings of unreadable topics by name.
        is_simulated: the metadata state that the devices were simulated.
    """

    path: Path
    format: str
    topics: dict[str, LogTopic]
    losses: list[str]
    unread: dict[str, str]
    is_simulated: bool

    def messages(self, topics: Collection[str]) -> Iterator[LogMessage]:
        """Yield every message of `topics` in file order.

        Raises:
            SettingsError: the log is damaged so that the rest cannot be read.
        """
        ...


class OneFile:
    """Base class of readers of a single file; see `LogFile`."""

    def __init__(self, path: Path, file: Path) -> None:
        """Initialise an empty log.

        Args:
            path: the file as given, which messages name.
            file: the file that is read: the same, or its unpacked copy.
        """
        self.path, self.file = path, file
        self.topics: dict[str, LogTopic] = {}
        self.losses: list[str] = []
        self.unread: dict[str, str] = {}
        self.unpacker = Unpacker(LARGEST_PART, LARGEST_RATIO)
        self.is_simulated = False  # default for formats without metadata


def damaged(path: Path, what: str, hint: str = "") -> SettingsError:
    """Make the error for an unusable log."""
    return SettingsError(
        f"{path}: {what}.", hint=hint or "Was the log copied completely?"
    )


def short_type(name: str) -> str:
    """Return a type name without the "msg" folder of ROS 2.

    sensor_msgs/msg/JointState and sensor_msgs/JointState are the same type.
    """
    package, _, rest = name.partition("/")
    return f"{package}/{rest.rpartition('/')[2]}" if rest else name


def checked_name(path: Path, name: bytes | str, what: str) -> str:
    """Return a name from a log as text; raises SettingsError if it is too long."""
    size = len(name if isinstance(name, bytes) else name.encode(errors="replace"))
    if size > LONGEST_NAME:
        raise damaged(path, f"{what} of {size} bytes, the limit is {LONGEST_NAME}")
    return name.decode(errors="replace") if isinstance(name, bytes) else name


def first_byte(path: Path) -> bytes:
    """Return the first byte of a companion file; b"" if it is missing or empty."""
    try:
        with open_regular(path, is_link_followed=True) as file:
            return file.read(1)
    except FileNotFoundError:
        return b""
    except (UnfitFileError, OSError) as error:
        raise damaged(path, f"cannot be read ({error})") from error


def copy_bounded(sources: Sequence[Path], copies: Sequence[Path]) -> None:
    """Copy files whose total size is within the limit of a log.

    Raises:
        SettingsError: the files are too large, or cannot be read or written.
    """
    remaining = LARGEST_LOG
    for source, copy in zip(sources, copies, strict=True):
        try:
            with (
                open_regular(source, is_link_followed=True) as old,
                copy.open("wb") as new,
            ):
                while block := old.read(_BLOCK):
                    remaining -= len(block)
                    if remaining < 0:
                        raise too_large(source, LARGEST_LOG - remaining)
                    new.write(block)
        except (UnfitFileError, OSError) as error:
            raise damaged(source, f"cannot be copied ({error})") from error


def too_large(path: Path, size: int) -> SettingsError:
    """Make the error for a log of over 2 GB."""
    return damaged(
        path,
        f"{size / 1e9:.1f} GB, the limit is {LARGEST_LOG / 1e9:.0f} GB",
        "Cut it: ros2 bag convert, or mcap filter, with the two topics only.",
    )
