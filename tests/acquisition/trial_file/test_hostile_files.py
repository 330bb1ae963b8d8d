"""Hostile files take bounded memory and time; mutated ones are refused or correct."""

import io
import json
import re
import struct
import subprocess
import sys
import time
import tracemalloc

import lz4.frame
import numpy as np
import pytest
import zstandard

from acquisition.errors import TrialFileError
from acquisition.recording.recorder import seal
from acquisition.schema import CYCLE
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import recover_file, recovered_path
from tests.acquisition.forged import (
    CHUNK,
    chunk_content,
    padded_content,
    with_chunk,
    with_repeated_index,
)
from tests.acquisition.ros import messages_of
from tests.acquisition.trials import (
    flipped,
    make_cycles,
    resealed,
    span_of,
    summary_start,
    write_trial,
)

MIB = 2**20
SECONDS = 2.0  # CPU time that a file may take
MEMORY = 200 * MIB
ATTACHMENT, METADATA = 9, 12

# Reads and recovers each file under a limit of its address space; one line each.
READER = """
import json, resource, sys, time
from pathlib import Path
from acquisition.errors import TrialFileError
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import recover_file
pages = int(Path("/proc/self/statm").read_text().split()[0])
limit = pages * resource.getpagesize() + int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
for path in map(Path, sys.argv[2:]):
    report = {"name": path.stem}
    for job in (lambda p: TrialReader(p).cycles(), recover_file):
        start = time.process_time()
        try:
            job(path)
        except TrialFileError as error:
            reason = error.reason
        else:
            reason = None
        seconds = time.process_time() - start
        report["recover" if job is recover_file else "read"] = [reason, seconds]
    print(json.dumps(report))
"""


def lz4_zeros(size):
    """Return `size` zeros as an LZ4 frame, without having them in memory."""
    packer = lz4.frame.LZ4FrameCompressor()
    out = io.BytesIO()
    out.write(packer.begin())
    for _ in range(size // (4 * MIB)):
        out.write(packer.compress(bytes(4 * MIB)))
    out.write(packer.flush())
    return out.getvalue()


def lying_frame():
    """Return a zstd frame that states 4 GiB in a size field of eight bytes."""
    raw = zstandard.compress(chunk_content())
    return raw[:4] + b"\xc0\x58" + struct.pack("<Q", 4 * 2**30) + raw[7:]


def unsized_frame(window_log):
    """Return 64 MiB of zeros as a zstd frame that does not state its size."""
    options = zstandard.ZstdCompressionParameters(
        window_log=window_log, write_content_size=False
    )
    packer = zstandard.ZstdCompressor(compression_params=options)
    return packer.compress(bytes(64 * MIB))


def bombs():
    """Return name -> (content, pattern of the refusal) of files that unpack to much."""
    size = len(chunk_content())
    zeros = lz4_zeros(2**30)
    big = padded_content(15 * MIB)
    honest = with_chunk(zstandard.compress(big), len(big))
    return {
        "zstd-states-4-gib": (with_chunk(lying_frame(), size), "unpack to 4294967296"),
        "zstd-unsized": (with_chunk(unsized_frame(20), size), "full frame"),
        "zstd-wide-window": (with_chunk(unsized_frame(27), size), "too much memory"),
        "lz4-zeros": (with_chunk(zeros, size, "lz4"), f"more than {size} bytes"),
        "lz4-zeros-16-mib": (with_chunk(zeros, 16 * MIB, "lz4"), "more than 16777216"),
        "index-1000-times": (with_repeated_index(honest, 1000), "1001 chunks of"),
        "index-thrice": (with_repeated_index(honest, 2), "more messages"),
    }


def liars(data):
    """Return name -> (content, pattern of the refusal) of damage and false lengths."""
    chunk, metadata = span_of(data, CHUNK), span_of(data, METADATA)
    attachment = span_of(data, ATTACHMENT)
    content = data.index(b"text/plain", attachment.start) + len(b"text/plain")

    def stating(at):
        changed = bytearray(data)
        struct.pack_into("<Q", changed, at, 2**40)
        return resealed(bytes(changed))

    return {
        "chunk": (stating(chunk.start + 1), "no chunk at"),
        "chunk-data": (stating(chunk.body + 36), "impossible length"),
        "metadata": (stating(metadata.start + 1), "no metadata at"),
        "attachment": (stating(attachment.start + 1), "no attachment at"),
        "attachment-data": (stating(content), "not a readable"),
        "truncated": (data[: len(data) // 2], "cut off"),
        "flip-in-chunk": (flipped(data, chunk.body + 100), "data whose checksum"),
        "flip-in-summary": (flipped(data, len(data) - 200), "summary whose checksum"),
        "flip-in-metadata": (flipped(data, metadata.body + 9), "data whose checksum"),
        "flip-in-attachment": (flipped(data, content + 50), "data whose checksum"),
    }


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    """Return the bytes of a good trial and everything in it."""
    path = tmp_path_factory.mktemp("good") / "T01.mcap"
    seal(write_trial(path, make_cycles(300), block=50), "travel")
    return path.read_bytes(), everything(path)


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory, pristine):
    """Return name -> (pattern, report of the process with little memory)."""
    folder = tmp_path_factory.mktemp("hostile")
    files = bombs() | liars(pristine[0])
    for name, (content, _) in files.items():
        (folder / f"{name}.mcap").write_bytes(content)
    paths = [str(folder / f"{name}.mcap") for name in files]
    done = subprocess.run(
        [sys.executable, "-c", READER, str(MEMORY), *paths],
        capture_output=True,
        text=True,
        check=True,
    )
    reports = {row["name"]: row for row in map(json.loads, done.stdout.splitlines())}
    return {name: (pattern, reports[name]) for name, (_, pattern) in files.items()}


NAMES = [
    "zstd-states-4-gib",
    "zstd-unsized",
    "zstd-wide-window",
    "lz4-zeros",
    "lz4-zeros-16-mib",
    "index-1000-times",
    "index-thrice",
    "chunk",
    "chunk-data",
    "metadata",
    "attachment",
    "attachment-data",
    "truncated",
    "flip-in-chunk",
    "flip-in-summary",
    "flip-in-metadata",
    "flip-in-attachment",
]
LOST = {"zstd-states-4-gib", "zstd-unsized", "zstd-wide-window", "lz4-zeros"}


def test_every_hostile_file_has_its_test(verdicts):
    assert sorted(verdicts) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_hostile_file_is_refused_for_its_cause_in_bounded_memory(verdicts, name):
    pattern, report = verdicts[name]
    reason, seconds = report["read"]
    assert re.search(pattern, reason or "")
    assert "MemoryError" not in reason
    assert seconds < SECONDS


@pytest.mark.parametrize("name", NAMES)
def test_recovering_a_hostile_file_takes_bounded_memory(verdicts, name):
    reason, seconds = verdicts[name][1]["recover"]
    assert "MemoryError" not in (reason or "")
    assert seconds < SECONDS
    if name in LOST:  # their only chunk is the bomb
        assert "nothing to save" in reason


def everything(path):
    """Return all cycles, metadata and attachments."""
    reader = TrialReader(path)
    rows = reader.cycles()
    columns = (rows.data.tobytes(), rows.log_time.tolist(), rows.sequence.tolist())
    return columns, reader.metadata, reader.attachments


def mutated(data, rng):
    """Return `data` with one flip, cut or splice somewhere."""
    kind = rng.integers(3)
    at = int(rng.integers(len(data)))
    if kind == 0:
        return flipped(data, at, int(rng.integers(8)))
    length = int(rng.integers(1, 200))
    if kind == 1:
        return data[:at] + data[at + length :]
    source = int(rng.integers(len(data)))
    return data[:at] + data[source : source + length] + data[at:]


def forged(data, rng):
    """Return `data` with some bytes changed and the section checksums recomputed."""
    start = summary_start(data)
    at = int(rng.integers(8 if rng.integers(2) else start, len(data) - 16))
    noise = rng.bytes(int(rng.integers(1, 9)))
    return resealed(data[:at] + noise + data[at + len(noise) :])


def survey(path, spoil, pristine, rng, count):
    """Spoil and read `count` times in bounded time and memory; return the refusals."""
    data, wanted = pristine
    refused = 0
    tracemalloc.start()
    try:
        for _ in range(count):
            path.write_bytes(spoil(data, rng))
            tracemalloc.reset_peak()
            start = time.process_time()
            try:
                found = everything(path)
            except TrialFileError:
                refused += 1
            else:
                assert spoil is forged or found == wanted
            assert time.process_time() - start < SECONDS
            assert tracemalloc.get_traced_memory()[1] < MEMORY
    finally:
        tracemalloc.stop()
    return refused


def is_recovered(path, wanted):
    """Recover `path`; return whether it gave a part of the good trial, in order."""
    target = recovered_path(path)
    target.unlink(missing_ok=True)
    try:
        recovery = recover_file(path)
    except TrialFileError:
        return False
    if recovery.path == path:
        return True
    (rows, times, numbers), _, _ = everything(target)
    size = CYCLE.size
    found = [rows[at : at + size] for at in range(0, len(rows), size)]
    good_rows, good_times, good_numbers = wanted[0]
    good = {
        good_rows[i * size : (i + 1) * size]: (time_ns, number)
        for i, (time_ns, number) in enumerate(
            zip(good_times, good_numbers, strict=True)
        )
    }
    pairs = list(zip(times, numbers, strict=True))
    assert [good[row] for row in found] == pairs == sorted(set(pairs))
    return True


def test_a_mutated_file_is_refused_or_read_correctly(tmp_path, pristine):
    rng = np.random.default_rng(1)
    refused = survey(tmp_path / "T.mcap", mutated, pristine, rng, 300)
    assert refused > 290  # nearly every byte of the file matters


def test_a_forged_file_is_refused_or_read_in_bounds(tmp_path, pristine):
    rng = np.random.default_rng(2)
    assert survey(tmp_path / "T.mcap", forged, pristine, rng, 300) > 150


def recovered_share(path, pristine, rng, count):
    """Mutate and recover `count` times; return the number of recovered trials."""
    data, wanted = pristine
    recovered = 0
    for _ in range(count):
        path.write_bytes(mutated(data, rng))
        start = time.process_time()
        recovered += is_recovered(path, wanted)
        assert time.process_time() - start < SECONDS
    return recovered / count


def test_data_recovered_from_a_mutated_file_are_correct(tmp_path, pristine):
    rng = np.random.default_rng(7)
    # most of the file is chunks, and most of them follow another one
    assert recovered_share(tmp_path / "T.mcap", pristine, rng, 60) > 0.5


@pytest.mark.long
@pytest.mark.timeout(300)
def test_many_mutated_files_are_refused_or_read_correctly(tmp_path, pristine):
    rng = np.random.default_rng(2000)
    assert survey(tmp_path / "T.mcap", mutated, pristine, rng, 2000) > 1900
    assert survey(tmp_path / "T.mcap", forged, pristine, rng, 2000) > 1000


@pytest.mark.long
@pytest.mark.timeout(300)
def test_data_recovered_from_many_mutated_files_are_correct(tmp_path, pristine):
    rng = np.random.default_rng(2001)
    assert recovered_share(tmp_path / "T.mcap", pristine, rng, 2000) > 0.5


def test_the_valid_file_is_read_as_by_rosbags(tmp_path, pristine):
    path = tmp_path / "T.mcap"
    path.write_bytes(pristine[0])
    theirs = messages_of(path)["/cycle"]
    rows, times, _ = pristine[1][0]
    assert rows == b"".join(content for _, content in theirs)
    assert times == [time_ns for time_ns, _ in theirs]
