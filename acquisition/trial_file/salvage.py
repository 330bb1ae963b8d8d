"""The sound beginning of a broken MCAP file: everything up to the first bad record."""

import io
import struct
import zlib
from collections.abc import Generator
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Message, Metadata, Schema

from acquisition.errors import TrialFileError
from acquisition.trial_file.checksums import MAGIC
from acquisition.trial_file.chunks import (
    RawRecord,
    Unpacker,
    as_trial_file_error,
    parse_chunk,
    record_at,
    unpacked_limit,
)

Salvaged = Schema | Channel | Message | Metadata | Attachment
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK_TIMES = struct.Struct("<BQQQ")  # opcode, length, start, end
_CRC = struct.Struct("<I")
_INDEX = struct.Struct("<HI")  # channel, bytes of pairs of 16
_LONGEST_NS = 3600 * 10**9  # a chunk that claims to be later than this is not believed


class SoundRecords:
    """Iterates once over the sound records at the beginning of `data`.

    A chunk's records come when all of it proved sound, or not at all. The one damage
    that is survived is an attachment whose checksum is wrong: it is left out.

    Attributes:
        reason: why the reading ended early; empty when all of the data were read.
        kept_bytes: offset of the first broken record, or of the end of the data.
        last_ns: largest log time of the chunks so far, as they state it [ns].
        left_out: names of damaged attachments.
    """

    def __init__(self, data: bytes, path: Path) -> None:
        self.reason = ""
        self.kept_bytes = 0
        self.last_ns = 0
        self.left_out: list[str] = []
        self._data = memoryview(data)
        self._path = path
        self._unpacker = Unpacker(path)
        self._room = unpacked_limit(len(data))
        self._schemas = {0}
        self._channels: set[int] = set()

    def __iter__(self) -> Generator[Salvaged]:
        if bytes(self._data[: len(MAGIC)]) != MAGIC:
            self.reason = "is no MCAP file"
            return
        self.kept_bytes = len(MAGIC)
        while True:
            raw = record_at(self._data, self.kept_bytes)
            if raw is None:
                is_at_end = self.kept_bytes == len(self._data)
                where = "after" if is_at_end else "in the record at"
                self.reason = f"is cut off {where} byte {self.kept_bytes}"
                return
            if raw.opcode == Opcode.DATA_END:
                return
            try:
                with as_trial_file_error(self._path):
                    yield from self._read(raw)
            except TrialFileError as error:
                self.reason = f"{error.reason} (byte {self.kept_bytes})"
                return
            self.kept_bytes = raw.end

    @property
    def lost_seconds(self) -> float:
        """How far the lost chunks reach, from what is left of their heads [s]."""
        last_ns, at = self.last_ns, self.kept_bytes
        while self.reason and at + _CHUNK_TIMES.size <= len(self._data):
            opcode, _, start_ns, end_ns = _CHUNK_TIMES.unpack_from(self._data, at)
            is_next = self.last_ns <= start_ns <= end_ns < self.last_ns + _LONGEST_NS
            if opcode == Opcode.CHUNK and is_next:
                last_ns = max(last_ns, end_ns)
            raw = record_at(self._data, at)
            if raw is None:
                break
            at = raw.end
        return (last_ns - self.last_ns) * 1e-9

    def _read(self, raw: RawRecord) -> Generator[Salvaged]:
        """Give the records of one top-level record; it raises before it gives any."""
        match raw.opcode:
            case Opcode.CHUNK:
                yield from self._read_chunk(raw.body)
            case Opcode.METADATA:
                yield Metadata.read(_stream(raw.body))
            case Opcode.ATTACHMENT:
                yield from self._read_attachment(raw.body)
            case Opcode.SCHEMA | Opcode.CHANNEL | Opcode.MESSAGE:
                yield self._parse(raw)
            case Opcode.HEADER if self.kept_bytes == len(MAGIC):
                pass
            case Opcode.MESSAGE_INDEX if _is_index(raw.body):
                pass
            case opcode:  # perhaps a chunk once: what follows would have a hole before
                raise TrialFileError(self._path, f"has a broken record, kind {opcode}")

    def _read_chunk(self, body: memoryview) -> Generator[Salvaged]:
        chunk = parse_chunk(body, self._path)
        self._room -= chunk.size
        if self._room < 0:
            raise TrialFileError(self._path, "has chunks that unpack to too much")
        data = memoryview(self._unpacker.unpack(chunk))
        for raw in self._split(data):
            self._parse(raw)
        for raw in self._split(data):
            yield self._parse(raw)
        self.last_ns = max(self.last_ns, chunk.end_ns)

    def _split(self, data: memoryview) -> Generator[RawRecord]:
        at = 0
        while at < len(data):
            raw = record_at(data, at)
            if raw is None:
                raise TrialFileError(self._path, "has a chunk that ends in a record")
            if raw.opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                yield raw
            at = raw.end

    def _parse(self, raw: RawRecord) -> Salvaged:
        if raw.opcode == Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(raw.body)
            if channel not in self._channels:
                raise TrialFileError(self._path, "has messages without a channel")
            content = bytes(raw.body[_MESSAGE.size :])
            return Message(channel, log_time, content, publish_time, sequence)
        if raw.opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(raw.body))
            self._schemas.add(schema.id)
            return schema
        record = Channel.read(_stream(raw.body))
        if record.schema_id not in self._schemas:
            raise TrialFileError(self._path, "has a channel without a schema")
        self._channels.add(record.id)
        return record

    def _read_attachment(self, body: memoryview) -> Generator[Attachment]:
        attachment = Attachment.read(_stream(body))
        if zlib.crc32(body[: -_CRC.size]) == _CRC.unpack(body[-_CRC.size :])[0]:
            yield attachment
        else:
            self.left_out.append(attachment.name)


def recorded_seconds(data: bytes) -> float:
    """Return how long the sound part of a recording is, from its chunks' heads [s]."""
    at, first_ns, last_ns = len(MAGIC), None, 0
    whole = memoryview(data)
    while (raw := record_at(whole, at)) is not None:
        if raw.opcode == Opcode.CHUNK and len(raw.body) >= 16:
            start_ns, end_ns = struct.unpack_from("<QQ", raw.body)
            first_ns = start_ns if first_ns is None else min(first_ns, start_ns)
            last_ns = max(last_ns, end_ns)
        at = raw.end
    return 0.0 if first_ns is None else max(0, last_ns - first_ns) * 1e-9


def _is_index(body: memoryview) -> bool:
    if len(body) < _INDEX.size:
        return False
    size = _INDEX.unpack_from(body)[1]
    return size == len(body) - _INDEX.size and size % 16 == 0


def _stream(body: memoryview) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(body))
