"""What a log holds, whatever its format: topics, and their messages in file order."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, open_regular
from acquisition.trial_file.unpacking import Unpacker

LARGEST_LOG = 2 * 10**9  # bytes on the disk
LARGEST_PART = 64 * 2**20  # bytes of a record, and of a chunk unpacked
LARGEST_RATIO = 100  # of a part unpacked to the same part packed
MOST_MESSAGES = 10**7  # of the topics that are read
LONGEST_NAME = 4096  # bytes of a topic, a type, a frame or a joint
MOST_TOPICS = 5_000
_BLOCK = 2**20  # bytes copied at a time

Serialization = Literal["cdr", "ros1"]


@dataclass(frozen=True, slots=True)
class LogTopic:
    """One topic of a log.

    Attributes:
        name: e.g. /joint_states.
        type_name: package and type, e.g. sensor_msgs/JointState.
        serialization: how its messages are written.
    """

    name: str
    type_name: str
    serialization: Serialization


class LogMessage(NamedTuple):
    """One message as it is stored.

    Attributes:
        topic: name of its topic.
        received_ns: when it was received [UTC ns].
        data: its bytes.
    """

    topic: str
    received_ns: int
    data: bytes


class LogFile(Protocol):
    """A log of one format.

    Attributes:
        path: the file.
        format: what it is, in words.
        topics: by name.
        losses: what could not be read, in words; complete after `messages` ended.
        unread: types and encodings of topics that cannot be read, by name.
        is_simulated: its own metadata says that the devices were simulated.
    """

    path: Path
    format: str
    topics: dict[str, LogTopic]
    losses: list[str]
    unread: dict[str, str]
    is_simulated: bool

    def messages(self, topics: Collection[str]) -> Iterator[LogMessage]:
        """Give every message of `topics`, in the order of the file.

        Raises:
            SettingsError: the log is damaged where nothing behind it can be read.
        """
        ...


class OneFile:
    """What every reader of one file begins with; see `LogFile`."""

    def __init__(self, path: Path) -> None:
        """Nothing of it is known yet.

        Args:
            path: the file.
        """
        self.path = path
        self.topics: dict[str, LogTopic] = {}
        self.losses: list[str] = []
        self.unread: dict[str, str] = {}
        self.unpacker = Unpacker(LARGEST_PART, LARGEST_RATIO)
        self.is_simulated = False  # some formats have no metadata that could say so


def damaged(path: Path, what: str, hint: str = "") -> SettingsError:
    """Return a refusal of a log."""
    return SettingsError(
        f"{path}: {what}.", hint=hint or "Was the log copied completely?"
    )


def short_type(name: str) -> str:
    """Return a type without the folder that ROS 2 puts into its name.

    sensor_msgs/msg/JointState and sensor_msgs/JointState are the same type.
    """
    package, _, rest = name.partition("/")
    return f"{package}/{rest.rpartition('/')[2]}" if rest else name


def checked_name(path: Path, name: bytes | str, what: str) -> str:
    """Return a name of a log as text; raises SettingsError where it is too long."""
    size = len(name if isinstance(name, bytes) else name.encode(errors="replace"))
    if size > LONGEST_NAME:
        raise damaged(path, f"{what} of {size} bytes, the limit is {LONGEST_NAME}")
    return name.decode(errors="replace") if isinstance(name, bytes) else name


def first_byte(path: Path) -> bytes:
    """First byte of a file beside a log; b"" where there is none, or nothing in it."""
    try:
        with open_regular(path, is_link_followed=True) as file:
            return file.read(1)
    except FileNotFoundError:
        return b""
    except (UnfitFileError, OSError) as error:
        raise damaged(path, f"cannot be read ({error})") from error


def copy_bounded(sources: Sequence[Path], copies: Sequence[Path]) -> None:
    """Copy files whose size together is within the limit of a log.

    Raises:
        SettingsError: they are too large, or one cannot be read or written.
    """
    left = LARGEST_LOG
    for source, copy in zip(sources, copies, strict=True):
        try:
            with (
                open_regular(source, is_link_followed=True) as old,
                copy.open("wb") as new,
            ):
                while block := old.read(_BLOCK):
                    left -= len(block)
                    if left < 0:
                        raise too_large(source, LARGEST_LOG - left)
                    new.write(block)
        except (UnfitFileError, OSError) as error:
            raise damaged(source, f"cannot be copied ({error})") from error


def too_large(path: Path, size: int) -> SettingsError:
    """Return the refusal of a log of over 2 GB."""
    return damaged(
        path,
        f"{size / 1e9:.1f} GB, the limit is {LARGEST_LOG / 1e9:.0f} GB",
        "Cut it: ros2 bag convert, or mcap filter, with the two topics only.",
    )
