"""TrialReader: trial files to numpy arrays; refuses damaged and hostile files."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import ChunkIndex
from numpy.typing import NDArray

from acquisition.errors import TrialFileError
from acquisition.formats import format_problem
from acquisition.sample import Record
from acquisition.schema import (
    CYCLE,
    TRUTH,
    Layout,
)
from acquisition.trial_file.contents import (
    RECORD_LIMIT,
    as_trial_file_error,
    read_contents,
)
from acquisition.trial_file.foreign import foreign_reason
from acquisition.trial_file.records import (
    HEAD_BYTES,
    body_at,
    message_index,
    parse_chunk,
    unpacked,
)
from acquisition.trial_file.unpacking import Unpacker

MAX_ROWS = 300_000  # ten minutes
_FOREIGN = "Write t, v_t, F_n and F_t of it as a table, then: traction fit FILE."
_HEAD = np.dtype(
    [
        ("op", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)


@dataclass(frozen=True, slots=True)
class TopicRows:
    """Messages of one topic.

    Attributes:
        data: records in the layout of the message, shape (n,).
        log_time: UTC [ns], shape (n,).
        sequence: message sequence numbers, shape (n,).
    """

    data: Record
    log_time: NDArray[np.uint64]
    sequence: NDArray[np.uint32]


class TrialReader:
    """Reads and validates one trial file.

    The file is read once and kept in memory; sizes are checked before allocation.

    Attributes:
        path: path of the file.
        size: size of the file [bytes].
        metadata: metadata by name.
        attachments: contents by name; the names are not paths.

    Raises:
        TrialFileError: the file is missing, foreign, truncated, damaged or hostile.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._contents = read_contents(path)
        except TrialFileError as error:
            if reason := foreign_reason(path):
                raise TrialFileError(path, reason, hint=_FOREIGN) from error
            raise
        self._unpacker = Unpacker(RECORD_LIMIT)
        self.path = path
        self.size = self._contents.size
        self.summary = self._contents.summary
        self.metadata = self._contents.metadata
        self.attachments = self._contents.attachments
        if "trial" not in self.metadata:
            reason = foreign_reason(path) or "is an MCAP file, but no trial of Traction"
            raise TrialFileError(path, reason, hint=_FOREIGN)
        if problem := format_problem(self.metadata["trial"].get("format_version")):
            raise TrialFileError(path, problem)

    @property
    def is_complete(self) -> bool:
        """Whether the recording was ended properly; False for a recovered one."""
        return self.metadata.get("result", {}).get("complete") == "true"

    @property
    def is_simulated(self) -> bool:
        """Whether the trial came from simulated devices."""
        return self.metadata["trial"].get("simulated") == "true"

    def cycles(self) -> TopicRows:
        """Return all records of `/cycle` in order."""
        return self._rows("/cycle", CYCLE)

    def truth(self) -> TopicRows:
        """Return all records of `/truth` in order (truth files of simulations)."""
        return self._rows("/truth", TRUTH)

    def topic_counts(self) -> dict[str, int]:
        """Return the number of messages per topic, from the statistics."""
        assert self.summary.statistics is not None
        counts = self.summary.statistics.channel_message_counts
        return {c.topic: counts.get(i, 0) for i, c in self.summary.channels.items()}

    def _rows(self, topic: str, layout: Layout) -> TopicRows:
        with as_trial_file_error(self.path):
            channel = self._channel(topic, layout)
            chunks = [
                index
                for index in self.summary.chunk_indexes
                if channel in index.message_index_offsets
            ]
            count = self.topic_counts()[topic]
            available = sum(chunk.uncompressed_size for chunk in chunks)
            if count > MAX_ROWS or count * (_HEAD.itemsize + layout.size) > available:
                raise TrialFileError(self.path, f"claims {count} messages of {topic}")
            heads = np.empty(count, _HEAD)
            data = np.empty(count, layout.dtype)
            filled = 0
            for index in chunks:
                filled += self._copy(index, channel, heads[filled:], data[filled:])
            if filled != count:
                raise TrialFileError(
                    self.path, f"{topic}: {filled} messages, {count} announced"
                )
            self._check_rows(heads, data, layout, channel)
            return TopicRows(data, heads["log_time"].copy(), heads["sequence"].copy())

    def _copy(self, index: ChunkIndex, channel: int, heads: Record, out: Record) -> int:
        """Copy the messages of `channel` in one chunk; return their number."""
        data = self._unpacked(index)
        offsets = self._message_offsets(index, channel)
        count = len(offsets)
        if count > len(out):
            raise TrialFileError(self.path, "has more messages than announced")
        limit = len(data) - _HEAD.itemsize - out.dtype.itemsize + 1
        if count and not 0 <= int(offsets.max()) < limit:
            raise TrialFileError(self.path, "has an index outside its chunk")
        if count:
            at = offsets.astype(np.intp)
            _gather(data, 0, at, heads)
            _gather(data, _HEAD.itemsize, at, out)
        return count

    def _check_rows(
        self, heads: Record, data: Record, layout: Layout, channel: int
    ) -> None:
        """Require that every row is a message of `channel` in this layout."""
        length = _HEAD.itemsize - HEAD_BYTES + layout.size
        good = (heads["op"] == Opcode.MESSAGE) & (heads["length"] == length)
        if not bool((good & (heads["channel"] == channel)).all()):
            raise TrialFileError(self.path, "has an index that points at no message")
        template = np.frombuffer(layout.template, layout.dtype)
        names = ("encapsulation", "frame_id_length", "frame_id")
        if not all(bool((data[name] == template[name]).all()) for name in names):
            raise TrialFileError(self.path, "has messages of an unknown layout")

    def _unpacked(self, index: ChunkIndex) -> memoryview:
        body = body_at(self._contents.data, index.chunk_start_offset, Opcode.CHUNK)
        chunk = parse_chunk(body, RECORD_LIMIT)
        actual = (len(body), chunk.size, chunk.compression, len(chunk.packed))
        if actual != (
            index.chunk_length - HEAD_BYTES,
            index.uncompressed_size,
            index.compression,
            index.compressed_size,
        ):
            raise TrialFileError(self.path, "has a chunk that its index does not match")
        return unpacked(chunk, self._unpacker)

    def _message_offsets(self, index: ChunkIndex, channel: int) -> NDArray[np.uint64]:
        offset = index.message_index_offsets[channel]
        body = body_at(self._contents.data, offset, Opcode.MESSAGE_INDEX)
        actual, pairs = message_index(body)
        if actual != channel:
            raise TrialFileError(self.path, "has a damaged message index")
        return np.frombuffer(pairs, "<u8")[1::2]

    def _channel(self, topic: str, layout: Layout) -> int:
        """Return the channel of a topic; raise unless it has this layout."""
        for number, channel in self.summary.channels.items():
            if channel.topic == topic:
                schema = self.summary.schemas.get(channel.schema_id)
                if schema is None or schema.name != layout.type_name:
                    raise TrialFileError(
                        self.path, f"{topic} is not a {layout.type_name}"
                    )
                if _fields(schema.data.decode()) != _fields(layout.definition):
                    raise TrialFileError(self.path, f"{topic} has other fields")
                return number
        raise TrialFileError(self.path, f"has no topic {topic}")


def _gather(
    data: memoryview, start: int, offsets: NDArray[np.intp], out: Record
) -> None:
    """Set out[i] to the bytes of `data` at offsets[i] + start.

    Indexes a strided view with a window at every byte; `np.take` would first copy all
    windows.
    """
    size = out.dtype.itemsize
    count = len(data) - start - size + 1
    windows = np.ndarray((count,), f"V{size}", data, offset=start, strides=(1,))
    out.view(f"V{size}")[: len(offsets)] = windows[offsets]


def _fields(text: str) -> list[str]:
    """Return the lines of a message definition without comments."""
    lines = (line.split("#")[0].split() for line in text.splitlines())
    return [" ".join(words) for words in lines if words]
