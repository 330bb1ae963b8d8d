"""Recordings with damaged blocks: every sound chunk is recovered, the loss reported."""

import numpy as np
import pytest

from acquisition.clock import NS_PER_S
from acquisition.errors import TrialFileError
from acquisition.recording.recorder import seal
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import recover_file
from acquisition.trial_file.verify import verify_file
from tests.acquisition.trials import (
    ATTACHMENTS,
    OFFSET_NS,
    make_cycles,
    span_of,
    spans,
    write_trial,
)

CHUNK, METADATA, ATTACHMENT = 6, 12, 9
BLOCK_BYTES = 4096  # that a disk loses at once
BLOCK = 130  # cycles in a chunk
CYCLES = make_cycles(3000, skipped=(1500, 2321))


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Return the bytes of a whole recording and of one that a kill left behind."""
    path = tmp_path_factory.mktemp("whole") / "T01.mcap"
    writer = write_trial(path, CYCLES, block=BLOCK)
    partial = writer.partial.read_bytes()
    seal(writer, "travel")
    return {"T01.mcap": path.read_bytes(), "T01.mcap.partial": partial}


def with_damaged_blocks(data, at, how):
    """Return `data` with the blocks of numbers `at` damaged."""
    out = bytearray(data)
    for block in at:
        start = block * BLOCK_BYTES
        end = min(start + BLOCK_BYTES, len(out))
        if how == "zeroed":
            out[start:end] = bytes(end - start)
        else:
            out[start + (end - start) // 2] ^= 0x10
    return bytes(out)


def whole_chunks(data, damaged):
    """Return a mask of the cycles in undamaged chunks."""
    found = [s for s in spans(data + bytes(8)) if s.opcode == CHUNK]
    is_sound = np.ones(len(CYCLES), bool)
    for i, span in enumerate(found):
        if data[span.start : span.end] != damaged[span.start : span.end]:
            is_sound[i * BLOCK : (i + 1) * BLOCK] = False
    return is_sound


def damaged_descriptions(data, damaged):
    """Return which of the two groups of metadata at the head are damaged."""
    head = span_of(data + bytes(8), CHUNK).start
    found = [s for s in spans(data + bytes(8)) if s.end <= head]
    between = next(s for s in found if s.opcode == ATTACHMENT).start
    return {
        span.start < between
        for span in found
        if span.opcode == METADATA
        and data[span.start : span.end] != damaged[span.start : span.end]
    }


def lost_seconds(is_sound):
    """Return the duration of all runs of lost cycles, missed ones included [s]."""
    times = CYCLES["host_ns"].astype(np.int64)
    edges = np.flatnonzero(np.diff(np.concatenate([[1], is_sound, [1]])))
    total = 0
    for first, end in edges.reshape(-1, 2):
        behind = times[end] if end < len(times) else times[-1] + 2_000_000
        before = times[first - 1] if first else times[0] - 2_000_000
        total += behind - before - 2_000_000
    return total / NS_PER_S


def judge(folder, name, data, rng):
    """Damage, recover and compare with the sound part; return if there is a copy."""
    blocks = len(data) // BLOCK_BYTES + 1
    at = rng.choice(blocks, rng.integers(1, 6), replace=False)
    damaged = with_damaged_blocks(data, at, "zeroed" if rng.integers(2) else "flipped")
    if damaged == data:
        return True
    path = folder / name
    path.write_bytes(damaged)
    is_sound = whole_chunks(data, damaged)
    try:
        recovery = recover_file(path)
    except TrialFileError:
        # only if both copies of the trial's identity are damaged
        assert len(damaged_descriptions(data, damaged)) == 2, at
        return False
    reader = TrialReader(recovery.path)
    found = reader.cycles()
    assert found.data["cycle"].tolist() == CYCLES["cycle"][is_sound].tolist(), at
    for column in ("position", "wrench", "counts"):
        assert found.data[column].tobytes() == CYCLES[column][is_sound].tobytes()
    assert (found.log_time == CYCLES["host_ns"][is_sound] + OFFSET_NS).all()
    assert verify_file(recovery.path) == recovery.verified
    if name == "T01.mcap":  # known from its summary or chunk headers
        wanted = lost_seconds(is_sound)
        assert recovery.seconds_dropped == pytest.approx(wanted, abs=0.01), at
    missing = ATTACHMENTS.keys() - reader.attachments.keys()
    assert set(recovery.missing_attachments) == missing
    recovery.path.unlink()
    return True


@pytest.mark.slow
@pytest.mark.parametrize("name", ["T01.mcap", "T01.mcap.partial"])
def test_every_sound_chunk_is_recovered(tmp_path, recordings, name):
    rng = np.random.default_rng(5)
    saved = [judge(tmp_path, name, recordings[name], rng) for _ in range(15)]
    assert all(saved)


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", ["T01.mcap", "T01.mcap.partial"])
def test_every_sound_chunk_of_a_long_file_is_recovered(tmp_path, recordings, name):
    rng = np.random.default_rng(300)
    saved = [judge(tmp_path, name, recordings[name], rng) for _ in range(150)]
    assert sum(saved) >= 149


@pytest.mark.parametrize("name", ["T01.mcap", "T01.mcap.partial"])
def test_channels_are_recovered_when_the_first_chunk_is_lost(
    tmp_path, recordings, name
):
    data = bytearray(recordings[name])
    first = span_of(bytes(data) + bytes(8), CHUNK)
    data[first.body + 100] ^= 1
    path = tmp_path / name
    path.write_bytes(bytes(data))
    recovery = recover_file(path)
    found = TrialReader(recovery.path).cycles().data
    assert found["cycle"].tolist() == CYCLES["cycle"][BLOCK:].tolist()
    assert [(loss.start, loss.seconds) for loss in recovery.losses] == [(0.0, 0.26)]


def test_an_attachment_is_taken_from_a_file_with_the_same_content(tmp_path, recordings):
    data = bytearray(recordings["T01.mcap"])
    data[span_of(bytes(data), ATTACHMENT).end - 10] ^= 1
    path = tmp_path / "T01.mcap"
    path.write_bytes(bytes(data))
    seal(write_trial(tmp_path / "T02.mcap", make_cycles(10)), "travel")
    recovery = recover_file(path)
    assert recovery.missing_attachments == ()
    assert TrialReader(recovery.path).attachments == ATTACHMENTS
