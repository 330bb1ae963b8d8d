"""Sound records of a damaged MCAP file; damaged parts are skipped."""

import re
import struct
from collections.abc import Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Message, Metadata, Schema

from acquisition.errors import TrialFileError
from acquisition.schema import schema_text
from acquisition.trial_file.contents import (
    RECORD_LIMIT,
    as_trial_file_error,
    unpacked_limit,
)
from acquisition.trial_file.records import (
    MAGIC,
    RawRecord,
    has_checksum,
    is_whole_metadata,
    message_index,
    message_of,
    parse,
    parse_chunk,
    record_at,
    records_of,
    unpacked,
)
from acquisition.trial_file.unpacking import DamageError, Unpacker
from acquisition.trial_file.writer import topics_by_sizes

_CHUNK_TIMES = struct.Struct("<QQ")  # start, end: beginning of a chunk's body
_CRC = struct.Struct("<I")  # of the data section, in its end record
_LONGEST_NS = 3600 * 10**9  # largest plausible step to the time of a lost chunk
# Heads of records that can be verified, or of the end of data, below 16 MiB.
_VERIFIABLE = re.compile(rb"(?=[\x06\x09\x0c\x0f].{3}\x00{5})", re.DOTALL)
_DEFINITION = re.compile(rb"(?=[\x03\x04].{3}\x00{5})", re.DOTALL)
_CHUNK_INDEX = re.compile(rb"(?=\x08.{3}\x00{5})", re.DOTALL)
_INDEX_HEAD = struct.Struct("<QQQ")  # of a chunk index: start, end, offset
_DATA_END = struct.pack("<BQ", Opcode.DATA_END, _CRC.size)
_KINDS = range(Opcode.HEADER, Opcode.DATA_END + 1)


@dataclass(frozen=True, slots=True)
class Gap:
    """A skipped part, in its place among the sound records.

    Attributes:
        start: offset of the first damaged byte.
        end: offset of the next sound record, or of the end of the data.
        reason: kind of damage.
        first_ns: earliest log time of lost chunks by their heads or index [ns]; 0 =
            unknown.
        last_ns: latest log time of lost chunks [ns].
    """

    start: int
    end: int
    reason: str
    first_ns: int = 0
    last_ns: int = 0


Salvaged = Schema | Channel | Message | Metadata | Attachment | Gap


class SoundRecords:
    """Iterates once over the sound records of `data`, in order.

    A chunk's records are yielded only if the whole chunk is sound and later than those
    before. Damaged data are skipped up to the next record with valid framing or
    checksum, and replaced by a `Gap`. Channels defined in a lost chunk are taken from
    the summary, or from the definitions of this program.

    Attributes:
        reason: first damage; "" if all data were sound.
        gaps: skipped parts.
        last_ns: largest log time so far [ns]; -1 = none.
        left_out: names of damaged attachments.
    """

    def __init__(self, data: bytes, path: Path) -> None:
        self.reason = ""
        self.gaps: list[Gap] = []
        self.last_ns = -1
        self.left_out: list[str] = []
        self._data = data
        self._view = memoryview(data)
        self._path = path
        self._unpacker = Unpacker(RECORD_LIMIT)
        self._room = unpacked_limit(len(data))
        self._schemas = {0}
        self._channels: set[int] = set()

    @property
    def lost_bytes(self) -> int:
        """Number of skipped bytes."""
        return sum(gap.end - gap.start for gap in self.gaps)

    def __iter__(self) -> Generator[Salvaged]:
        at = len(MAGIC)
        if not self._data.startswith(MAGIC):
            at = self._next_sound(0)
            self.reason = "is no MCAP file"
            if at == len(self._data):
                return
            yield self._gap(0, at, self.reason)
        while True:
            raw = record_at(self._view, at)
            if raw is None and self._next_sound(at) == len(self._data):
                is_at_end = at == len(self._data)
                where = "after" if is_at_end else "in the record at"
                cut = f"is cut off {where} byte {at}"
                self.reason = self.reason or cut
                if not is_at_end:
                    yield self._gap(at, len(self._data), cut)
                return
            if raw is not None and raw.opcode == Opcode.DATA_END:
                return
            try:
                with as_trial_file_error(self._path):
                    if raw is None:
                        raise DamageError("a broken record")
                    yield from self._read(raw, at)
                    at = raw.end
            except TrialFileError as error:
                reason = f"{error.reason} (byte {at})"
                self.reason = self.reason or reason
                end = self._resume_offset(raw, at)
                yield self._gap(at, end, reason)
                at = end

    def _gap(self, start: int, end: int, reason: str) -> Gap:
        """Return a gap with the stated times of its lost chunks."""
        first_ns = last_ns = 0
        for start_ns, end_ns in self._stated_times(start, end):
            first_ns = min(first_ns or start_ns, start_ns)
            last_ns = max(last_ns, end_ns)
        gap = Gap(start, end, reason, first_ns, last_ns)
        self.gaps.append(gap)
        return gap

    def _stated_times(self, start: int, end: int) -> Iterator[tuple[int, int]]:
        """Yield the stated (start, end) times of the chunks in a gap.

        From the summary's chunk indexes and from remaining chunk heads.
        """
        for index in self._after_data(_CHUNK_INDEX):
            if len(index.body) < _INDEX_HEAD.size:
                continue
            start_ns, end_ns, offset = _INDEX_HEAD.unpack_from(index.body)
            if start <= offset < end and start_ns <= end_ns:
                yield start_ns, end_ns
        at = start
        while at + 9 + _CHUNK_TIMES.size <= end:
            start_ns, end_ns = _CHUNK_TIMES.unpack_from(self._data, at + 9)
            latest = (self.last_ns if self.last_ns > 0 else start_ns) + _LONGEST_NS
            is_next = 0 < start_ns <= end_ns and self.last_ns <= start_ns
            if self._data[at] == Opcode.CHUNK and is_next and end_ns < latest:
                yield start_ns, end_ns
            raw = record_at(self._view[:end], at)
            if raw is None:
                return
            at = raw.end

    def _resume_offset(self, raw: RawRecord | None, at: int) -> int:
        """Return the offset at which to continue after the damaged record at `at`."""
        if raw is not None and self._is_framed(raw.end):
            return raw.end
        return self._next_sound(at + 1)

    def _is_framed(self, at: int) -> bool:
        """Return whether a record of a known kind, or the end, is at `at`."""
        if at == len(self._data):
            return True
        raw = record_at(self._view, at)
        return raw is not None and raw.opcode in _KINDS

    def _next_sound(self, start: int) -> int:
        """Return the offset of the next verifiable record, or of the end."""
        for match in _VERIFIABLE.finditer(self._data, start):
            raw = record_at(self._view, match.start())
            if raw is not None and self._is_verified(raw):
                return match.start()
        return len(self._data)

    def _is_verified(self, raw: RawRecord) -> bool:
        try:
            with as_trial_file_error(self._path):
                match raw.opcode:
                    case Opcode.CHUNK:
                        return self._is_chunk(raw.body)
                    case Opcode.METADATA:
                        return is_whole_metadata(raw.body)
                    case Opcode.ATTACHMENT:
                        return has_checksum(raw.body)
                    case _:
                        return len(raw.body) == _CRC.size and self._is_framed(raw.end)
        except TrialFileError:
            return False

    def _is_chunk(self, body: memoryview) -> bool:
        """Return whether a chunk's checksum is correct, within the unpacking limit."""
        chunk = parse_chunk(body, RECORD_LIMIT)
        if not chunk.crc or chunk.size > self._room:
            return False
        self._room -= chunk.size
        unpacked(chunk, self._unpacker)
        self._room += chunk.size  # unpacked and counted again by _read_chunk
        return True

    def _read(self, raw: RawRecord, at: int) -> Generator[Salvaged]:
        """Yield the records of one top-level record, or raise before the first."""
        match raw.opcode:
            case Opcode.CHUNK:
                yield from self._read_chunk(raw.body)
            case Opcode.METADATA:
                yield parse(Metadata, raw.body)
            case Opcode.ATTACHMENT:
                yield from self._read_attachment(raw.body)
            case Opcode.SCHEMA | Opcode.CHANNEL | Opcode.MESSAGE:
                yield self._parse(raw)
            case Opcode.HEADER if at == len(MAGIC):
                pass
            case Opcode.MESSAGE_INDEX:
                message_index(raw.body)
            case opcode:  # possibly a damaged chunk
                raise DamageError(f"a broken record, kind {opcode}")

    def _read_chunk(self, body: memoryview) -> Generator[Salvaged]:
        chunk = parse_chunk(body, RECORD_LIMIT)
        self._room -= chunk.size
        if self._room < 0:
            raise DamageError("chunks that unpack to too much")
        data = unpacked(chunk, self._unpacker)
        saved = self._schemas.copy(), self._channels.copy()
        try:
            records = [self._parse(raw) for raw in _messages(data)]
        except _UnknownChannelError:
            self._schemas, self._channels = saved
            definitions = self._definitions(data)
            for definition in definitions:
                self._define(definition)
            records = [
                *definitions,
                *(self._parse(raw) for raw in _messages(data)),
            ]
        times = [record.log_time for record in records if isinstance(record, Message)]
        if times and max(times) <= self.last_ns:
            raise DamageError("a chunk out of order")
        yield from records
        self.last_ns = max(times, default=self.last_ns)

    def _parse(self, raw: RawRecord) -> Schema | Channel | Message:
        if raw.opcode == Opcode.MESSAGE:
            message = message_of(raw.body)
            if message.channel_id not in self._channels:
                raise _UnknownChannelError("messages without a channel")
            return message
        record = _definition(raw)
        self._define(record)
        return record

    def _define(self, record: Schema | Channel) -> None:
        if isinstance(record, Schema):
            self._schemas.add(record.id)
            return
        if record.schema_id not in self._schemas:
            raise DamageError("a channel without a schema")
        self._channels.add(record.id)

    def _definitions(self, data: memoryview) -> list[Schema | Channel]:
        """Return the definitions of a file in which they were lost.

        They are repeated in the summary; without one, those that this program always
        writes are used.

        Args:
            data: a sound chunk; the sizes of its messages identify the channels.
        """
        records = list(self._in_summary()) or list(_own_definitions(self._sizes(data)))
        return records if any(isinstance(r, Channel) for r in records) else []

    def _in_summary(self) -> Iterator[Schema | Channel]:
        """Yield the definitions in the summary."""
        for raw in self._after_data(_DEFINITION):
            try:
                with as_trial_file_error(self._path):
                    yield _definition(raw)
            except TrialFileError:
                continue

    def _after_data(self, kind: re.Pattern[bytes]) -> Iterator[RawRecord]:
        """Yield the undamaged records of a kind after the data section."""
        start = self._data.rfind(_DATA_END)
        if start < 0:
            return
        for match in kind.finditer(self._data, start):
            raw = record_at(self._view, match.start())
            if raw is not None and self._is_framed(raw.end):
                yield raw

    def _sizes(self, data: memoryview) -> dict[int, int]:
        """Return the size of the first message of each channel [bytes]."""
        sizes: dict[int, int] = {}
        for raw in _messages(data):
            if raw.opcode == Opcode.MESSAGE:
                message = message_of(raw.body)
                sizes.setdefault(message.channel_id, len(message.data))
        return sizes

    def _read_attachment(self, body: memoryview) -> Generator[Attachment]:
        attachment = parse(Attachment, body)
        if has_checksum(body):
            yield attachment
        else:
            self.left_out.append(attachment.name)


class _UnknownChannelError(DamageError):
    """A message refers to a channel that was not defined before it."""


def recorded_seconds(data: bytes) -> float:
    """Return the duration of the sound part of a recording by its chunk heads [s]."""
    at, first_ns, last_ns = len(MAGIC), None, 0
    whole = memoryview(data)
    while (raw := record_at(whole, at)) is not None:
        if raw.opcode == Opcode.CHUNK and len(raw.body) >= 16:
            start_ns, end_ns = struct.unpack_from("<QQ", raw.body)
            first_ns = start_ns if first_ns is None else min(first_ns, start_ns)
            last_ns = max(last_ns, end_ns)
        at = raw.end
    return 0.0 if first_ns is None else max(0, last_ns - first_ns) * 1e-9


def _definition(raw: RawRecord) -> Schema | Channel:
    return parse(Schema if raw.opcode == Opcode.SCHEMA else Channel, raw.body)


def _messages(chunk: memoryview) -> Iterator[RawRecord]:
    """Yield the messages, schemas and channels in a chunk."""
    for raw in records_of(chunk, what="a chunk"):
        if raw.opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            yield raw


def _own_definitions(sizes: Mapping[int, int]) -> Iterable[Schema | Channel]:
    """Yield the definitions at the beginning of a file of this program."""
    for number, (topic, name) in enumerate(topics_by_sizes(sizes).items(), 1):
        yield Schema(
            id=number, name=name, encoding="ros2msg", data=schema_text(name).encode()
        )
        yield Channel(
            id=number,
            topic=topic,
            message_encoding="cdr",
            schema_id=number,
            metadata={},
        )
