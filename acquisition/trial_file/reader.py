"""TrialReader: whole chunks into numpy arrays, damaged and hostile files refused."""

import struct
import zlib
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
import zstandard
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import ChunkIndex
from mcap.summary import Summary

from acquisition.errors import TrialFileError
from acquisition.messages import CYCLE, TRUTH, Layout
from acquisition.sample import Record
from acquisition.trial_file.checksums import MAGIC, check_checksums

RECORD_LIMIT = 16 * 1024 * 1024
MAX_CHUNKS = 100_000
MAX_NAMED = 1_000  # metadata records and attachments
MAX_ROWS = 10_000_000
MAX_BYTES = 4 * 2**30  # of all chunks, unpacked
_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log, publish
_CHUNK_HEAD = struct.Struct("<BQQQQI")  # opcode, length, start, end, size, crc
_MESSAGE = 5
_MESSAGE_INDEX = 7
_CHUNK = 6

_ERRORS = (
    McapError,
    struct.error,
    ValueError,
    KeyError,
    OSError,
    MemoryError,
    OverflowError,
    RuntimeError,
    zstandard.ZstdError,
)


@contextmanager
def as_trial_file_error(path: Path) -> Generator[None]:
    """Turn whatever a damaged file can raise into a TrialFileError."""
    try:
        yield
    except TrialFileError:
        raise
    except _ERRORS as error:
        detail = str(error) or type(error).__name__
        raise TrialFileError(
            path, f"is not a readable trial file ({detail})"
        ) from error


@dataclass(frozen=True, slots=True)
class Rows:
    """Messages of one topic.

    Attributes:
        data: records in the layout of the message, shape (n,).
        log_time: UTC [ns], shape (n,).
        sequence: message sequence numbers, shape (n,).
    """

    data: Record
    log_time: "np.ndarray[tuple[int], np.dtype[np.uint64]]"
    sequence: "np.ndarray[tuple[int], np.dtype[np.uint32]]"


class TrialReader:
    """Reads one trial file; everything it returns has been checked.

    Raises:
        TrialFileError: the file is missing, foreign, truncated, damaged or hostile.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._unpacker = zstandard.ZstdDecompressor()
        with as_trial_file_error(path), path.open("rb") as file:
            self.size = path.stat().st_size
            self._check_magic(file)
            reader = SeekingReader(
                file, validate_crcs=True, record_size_limit=RECORD_LIMIT
            )
            header = reader.get_header()
            if header.profile != "ros2":
                raise TrialFileError(path, f"has profile {header.profile!r}, not ros2")
            check_checksums(file, self.size, path)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                raise TrialFileError(path, "has no summary: was it closed properly?")
            self.summary: Summary = summary
            self._check_offsets()
            self.metadata = self._read_metadata(reader)
            self.attachments = {a.name: a.data for a in reader.iter_attachments()}
        if "trial" not in self.metadata:
            raise TrialFileError(path, "is an MCAP file, but no trial of Traction")

    @property
    def is_complete(self) -> bool:
        """Whether the recording was ended properly."""
        return self.metadata.get("result", {}).get("complete") == "true"

    @property
    def is_simulated(self) -> bool:
        """Whether the trial came from simulated devices."""
        return self.metadata["trial"].get("simulated") == "true"

    def cycles(self) -> Rows:
        """Return all records of `/cycle` in order."""
        return self._rows("/cycle", CYCLE)

    def truth(self) -> Rows:
        """Return all records of `/truth` in order (truth files of simulations)."""
        return self._rows("/truth", TRUTH)

    def topic_counts(self) -> dict[str, int]:
        """Return the number of messages per topic, from the statistics."""
        assert self.summary.statistics is not None
        counts = self.summary.statistics.channel_message_counts
        return {c.topic: counts.get(i, 0) for i, c in self.summary.channels.items()}

    def _rows(self, topic: str, layout: Layout) -> Rows:
        with as_trial_file_error(self.path):
            channel = self._channel(topic, layout.type_name)
            count = self.topic_counts()[topic]
            row_bytes = _HEAD.size + layout.size
            if count > MAX_ROWS or count * row_bytes > 2 * 2**30:
                raise TrialFileError(self.path, f"claims {count} messages of {topic}")
            out = np.empty(count, f"V{row_bytes}")
            filled = 0
            with self.path.open("rb") as file:
                for index in self.summary.chunk_indexes:
                    filled += self._read_chunk(file, index, channel, out[filled:])
            if filled != count:
                raise TrialFileError(
                    self.path, f"{topic}: {filled} messages, {count} announced"
                )
            return self._split(out, layout, channel)

    def _split(self, out: Record, layout: Layout, channel: int) -> Rows:
        names = ["op", "length", "channel", "sequence", "log_time", "publish", "data"]
        formats = ["u1", "<u8", "<u2", "<u4", "<u8", "<u8", layout.dtype]
        dtype = np.dtype(
            {
                "names": names,
                "formats": formats,
                "offsets": [0, 1, 9, 11, 15, 23, 31],
                "itemsize": _HEAD.size + layout.size,
            }
        )
        rows = out.view(dtype)
        length = _HEAD.size - 9 + layout.size
        good = (rows["op"] == _MESSAGE) & (rows["length"] == length)
        if not bool((good & (rows["channel"] == channel)).all()):
            raise TrialFileError(self.path, "has an index that points at no message")
        wanted = np.frombuffer(layout.template, layout.dtype)
        names = ("encapsulation", "frame_id_length", "frame_id")
        if not all(bool((rows["data"][n] == wanted[n]).all()) for n in names):
            raise TrialFileError(self.path, "has messages of an unknown layout")
        return Rows(
            data=_payloads(out, layout),
            log_time=rows["log_time"].copy(),
            sequence=rows["sequence"].copy(),
        )

    def _read_chunk(
        self, file: IO[bytes], index: ChunkIndex, channel: int, out: Record
    ) -> int:
        offset = index.message_index_offsets.get(channel)
        if offset is None:
            return 0
        data = self._decompress(file, index)
        offsets = self._message_offsets(file, offset, channel, len(data))
        row_bytes = out.dtype.itemsize
        if len(offsets) > len(out) or len(data) < row_bytes:
            raise TrialFileError(self.path, "has more messages than announced")
        windows = np.ndarray(
            (len(data) - row_bytes + 1,), f"V{row_bytes}", data, strides=(1,)
        )
        if offsets.size and int(offsets.max()) >= len(windows):
            raise TrialFileError(self.path, "has an index outside its chunk")
        out[: len(offsets)] = windows[offsets.astype(np.int64)]
        return len(offsets)

    def _decompress(self, file: IO[bytes], index: ChunkIndex) -> bytes:
        """Return the records of a chunk; checks sizes before and CRC after."""
        if index.uncompressed_size > RECORD_LIMIT:
            raise TrialFileError(self.path, "has a chunk that states over 16 MiB")
        if index.compression not in ("", "zstd"):
            raise TrialFileError(
                self.path, f"uses compression {index.compression!r}, expected zstd"
            )
        file.seek(index.chunk_start_offset)
        head = file.read(_CHUNK_HEAD.size)
        opcode, length, _, _, size, crc = _CHUNK_HEAD.unpack(head)
        name_length = struct.unpack("<I", file.read(4))[0]
        if (opcode, length + 9, size, name_length) != (
            _CHUNK,
            index.chunk_length,
            index.uncompressed_size,
            len(index.compression),
        ):
            raise TrialFileError(self.path, "has a chunk that its index does not match")
        file.seek(name_length, 1)
        stored = struct.unpack("<Q", file.read(8))[0]
        if stored != index.compressed_size or stored > self.size:
            raise TrialFileError(self.path, "has a chunk of impossible length")
        raw = file.read(stored)
        data = self._unzstd(raw, size) if index.compression else raw
        if len(data) != size or (crc and zlib.crc32(data) != crc):
            raise TrialFileError(self.path, "has a chunk whose checksum is wrong")
        return data

    def _unzstd(self, raw: bytes, size: int) -> bytes:
        stated = zstandard.frame_content_size(raw)
        if stated not in (-1, size):
            raise TrialFileError(
                self.path, f"has a chunk that would unpack to {stated} bytes"
            )
        return self._unpacker.decompress(raw, max_output_size=size)

    def _message_offsets(
        self, file: IO[bytes], offset: int, channel: int, limit: int
    ) -> "np.ndarray[tuple[int], np.dtype[np.uint64]]":
        file.seek(offset)
        opcode, _, found, size = struct.unpack("<BQHI", file.read(15))
        if opcode != _MESSAGE_INDEX or found != channel or size > 16 * limit:
            raise TrialFileError(self.path, "has a damaged message index")
        pairs = np.frombuffer(file.read(size), "<u8")
        return pairs[1::2]

    def _channel(self, topic: str, type_name: str) -> int:
        for number, channel in self.summary.channels.items():
            if channel.topic == topic:
                schema = self.summary.schemas.get(channel.schema_id)
                if schema is None or schema.name != type_name:
                    raise TrialFileError(self.path, f"{topic} is not a {type_name}")
                return number
        raise TrialFileError(self.path, f"has no topic {topic}")

    def _check_magic(self, file: IO[bytes]) -> None:
        if self.size < 2 * len(MAGIC) or file.read(len(MAGIC)) != MAGIC:
            raise TrialFileError(self.path, "is no MCAP file")
        file.seek(-len(MAGIC), 2)
        if file.read(len(MAGIC)) != MAGIC:
            raise TrialFileError(
                self.path,
                "is cut off: it does not end as an MCAP file does",
                hint=f"Salvage it: traction recover {self.path}",
            )
        file.seek(0)

    def _check_offsets(self) -> None:
        chunks = self.summary.chunk_indexes
        total = sum(chunk.uncompressed_size for chunk in chunks)
        if len(chunks) > MAX_CHUNKS or total > MAX_BYTES:
            raise TrialFileError(
                self.path, f"states {len(chunks)} chunks of {total} bytes"
            )
        indexes = (self.summary.metadata_indexes, self.summary.attachment_indexes)
        if max(len(found) for found in indexes) > MAX_NAMED:
            raise TrialFileError(self.path, f"states over {MAX_NAMED} attachments")
        for chunk in chunks:
            if chunk.chunk_start_offset + chunk.chunk_length > self.size:
                raise TrialFileError(self.path, "has a chunk beyond its end")

    def _read_metadata(self, reader: SeekingReader) -> dict[str, dict[str, str]]:
        return {m.name: dict(m.metadata) for m in reader.iter_metadata()}


def _payloads(rows: Record, layout: Layout) -> Record:
    """Return the messages without their heads; as bytes, four times as fast."""
    raw = rows.view(np.uint8).reshape(len(rows), rows.itemsize)[:, _HEAD.size :]
    return np.ascontiguousarray(raw).view(layout.dtype)[:, 0]
