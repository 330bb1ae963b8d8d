"""Streams of frames, some with one damaged byte."""

import random


def flip(rng: random.Random, data: bytearray) -> None:
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def drop(rng: random.Random, data: bytearray) -> None:
    del data[rng.randrange(len(data))]


def double(rng: random.Random, data: bytearray) -> None:
    position = rng.randrange(len(data))
    data.insert(position, data[position])


def damaged_stream(make, encode, fault, seed):
    """Return (bytes, frames, numbers of the damaged ones) of 150 frames, 30 damaged.

    Damaged frames are never adjacent: the last byte of one could replace the lost
    header of the next, so that no frame is lost.
    """
    rng = random.Random(seed)
    sent = [make(rng, number) for number in range(150)]
    encoded = [bytearray(encode(frame)) for frame in sent]
    hit = set(rng.sample(range(0, 149, 2), 30))
    for number in hit:
        fault(rng, encoded[number])
    return b"".join(encoded), sent, hit


def parse(scanner, data: bytes, chunk: int) -> list:
    """Return the frames that `scanner` finds in `data`, fed in pieces."""
    return [
        frame
        for start in range(0, len(data), chunk)
        for frame in scanner.feed(data[start : start + chunk])
    ]
