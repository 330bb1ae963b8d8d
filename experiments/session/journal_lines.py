"""The lines of a journal: one JSON object each, with a checksum of its own."""

import json
import re
import zlib
from collections.abc import Mapping
from typing import Any

from experiments.session.data_files import parse_object

_CRC = "crc"
_CHECKED = re.compile(rb'^(?P<body>\{.+), "crc": "(?P<crc>[0-9a-f]{8})"\}$')


def journal_line(event: Mapping[str, object]) -> bytes:
    """Return `event` as a line that carries the CRC-32 of what it would be without."""
    body = json.dumps(event, allow_nan=False).encode()
    crc = b', "%s": "%08x"}\n' % (_CRC.encode(), zlib.crc32(body))
    return body[:-1] + crc


def parse_line(line: bytes) -> dict[str, Any] | None:
    """Return the event of a line, None where it is torn or its checksum is wrong.

    A line of an older version has no checksum and is taken as it is.
    """
    event = parse_object(line)
    if event is None or _CRC not in event:
        return event
    found = _CHECKED.match(line.strip())
    if found is None or zlib.crc32(found["body"] + b"}") != int(found[_CRC], 16):
        return None
    del event[_CRC]
    return event


def damaged_lines(text: bytes) -> list[int]:
    """Return the numbers of lines with a wrong checksum, from 1; torn ones are none."""
    return [
        number
        for number, line in enumerate(text.splitlines(), 1)
        if parse_line(line) is None and parse_object(line) is not None
    ]
