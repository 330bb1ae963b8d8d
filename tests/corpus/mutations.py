"""Seeded random damage to bytes, lines, numbers and nesting."""

import re

import numpy as np

_TOKENS = (
    b"-1",
    b"0",
    b"1e400",
    b"nan",
    b"-inf",
    b"9" * 400,
    b"9" * 4299,
    b"9" * 5000,
    b"0x" + b"f" * 4000,
    b"1e30",
    b"99999999999999999999",
    b"true",
    b"null",
    b'""',
    b"[]",
    b"{}",
    b"[" * 3000,
    b'{"a":' * 3000,
    b"[" * 10_000,
    b"a." * 5000,
    b"\xff\xfe",
    b"\0",
    b"\n",
    b'"../../../out"',
    b"<script>",
    b"$(touch out)",
)
_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_MAX_DAMAGES = 4  # changes of one input


def mutated(data: bytes, seed: int) -> bytes:
    """Return `data` after one to four random changes drawn with `seed`."""
    rng = np.random.default_rng(seed)
    for _ in range(rng.integers(1, _MAX_DAMAGES, endpoint=True)):
        change = _CHANGES[rng.integers(len(_CHANGES))]
        data = change(data, rng)
    return data


def _offset(data: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(len(data) + 1))


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    if not data:
        return b"\xff"
    offset = _offset(data[1:], rng)
    damaged = data[offset] ^ 1 << int(rng.integers(8))
    return data[:offset] + bytes((damaged,)) + data[offset + 1 :]


def _remove(data: bytes, rng: np.random.Generator) -> bytes:
    first, last = sorted((_offset(data, rng), _offset(data, rng)))
    return data[:first] + data[last:]


def _truncate(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: _offset(data, rng)]


def _repeat(data: bytes, rng: np.random.Generator) -> bytes:
    first, last = sorted((_offset(data, rng), _offset(data, rng)))
    return data[:last] + data[first:last] + data[last:]


def _insert(data: bytes, rng: np.random.Generator) -> bytes:
    offset = _offset(data, rng)
    return data[:offset] + _TOKENS[rng.integers(len(_TOKENS))] + data[offset:]


def _other_number(data: bytes, rng: np.random.Generator) -> bytes:
    matches = list(_NUMBER.finditer(data))
    if not matches:
        return data
    number = matches[rng.integers(len(matches))]
    token = _TOKENS[rng.integers(len(_TOKENS))]
    return data[: number.start()] + token + data[number.end() :]


def _other_value(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace the value after a colon or an equals sign."""
    matches = list(re.finditer(rb"[:=]\s*([^,}\n]*)", data))
    if not matches:
        return data
    value = matches[rng.integers(len(matches))]
    token = _TOKENS[rng.integers(len(_TOKENS))]
    return data[: value.start(1)] + token + data[value.end(1) :]


def _swap_lines(data: bytes, rng: np.random.Generator) -> bytes:
    lines = data.splitlines(keepends=True)
    rng.shuffle(lines)
    return b"".join(lines)


_CHANGES = (
    _flip,
    _remove,
    _truncate,
    _repeat,
    _insert,
    _other_number,
    _other_value,
    _swap_lines,
)
