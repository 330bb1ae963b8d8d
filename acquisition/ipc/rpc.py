"""Questions and answers between processes: JSON over a socket pair, never pickled.

For what happens between trials; nothing here belongs into a running loop.
"""

import json
import select
import socket
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from acquisition import errors
from acquisition.errors import DeviceFaultError, TractionError, TrialFileError

_LENGTH = struct.Struct("<I")
LARGEST = 64 << 20  # bytes of one message

Handler = Callable[[Any], Any]


class ChannelClosedError(Exception):
    """The other side has gone."""


class Channel:
    """One end of a socket pair that carries whole JSON values."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end

    @classmethod
    def pair(cls) -> tuple["Channel", "Channel"]:
        """Return two connected ends."""
        one, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        return cls(one), cls(other)

    @classmethod
    def adopt(cls, descriptor: int) -> "Channel":
        """Return the end that was inherited as `descriptor`."""
        return cls(socket.socket(fileno=descriptor))

    def fileno(self) -> int:
        """Return the descriptor to wait on."""
        return self._socket.fileno()

    def is_readable(self, seconds: float = 0.0) -> bool:
        """Return whether something arrives, or the other side leaves, in `seconds`."""
        return bool(select.select([self._socket], [], [], seconds)[0])

    def send(self, value: object) -> None:
        """Send one value.

        Raises:
            ChannelClosedError: the other side has gone.
        """
        data = json.dumps(value).encode()
        try:
            self._socket.sendall(_LENGTH.pack(len(data)) + data)
        except OSError as error:
            raise ChannelClosedError from error

    def receive(self) -> Any:  # noqa: ANN401 - JSON has no narrower type
        """Wait for one value and return it.

        Raises:
            ChannelClosedError: the other side has gone, or talks nonsense.
        """
        (length,) = _LENGTH.unpack(self._exactly(_LENGTH.size))
        if length > LARGEST:
            raise ChannelClosedError
        try:
            return json.loads(self._exactly(length))
        except ValueError as error:
            raise ChannelClosedError from error

    def ask(self, question: str, argument: object = None) -> Any:  # noqa: ANN401
        """Put a question to the other side's `answer` and return what it says.

        Raises:
            TractionError: what the other side raised.
            ChannelClosedError: the other side has gone.
        """
        self.send([question, argument])
        answer = self.receive()
        if answer["error"] is not None:
            raise _error_of(answer["error"])
        return answer["value"]

    def answer(self, handlers: Mapping[str, Handler]) -> None:
        """Wait for one question and answer it; errors a person can understand too.

        Raises:
            ChannelClosedError: the other side has gone.
        """
        question, argument = self.receive()
        try:
            value, error = handlers[question](argument), None
        except TractionError as raised:
            value, error = None, _error_facts(raised)
        self.send({"value": value, "error": error})

    def close(self) -> None:
        """Hang up."""
        self._socket.close()

    def _exactly(self, size: int) -> bytes:
        parts: list[bytes] = []
        while size:
            try:
                part = self._socket.recv(min(size, 1 << 20))
            except OSError as error:
                raise ChannelClosedError from error
            if not part:
                raise ChannelClosedError
            parts.append(part)
            size -= len(part)
        return b"".join(parts)


def _error_facts(error: TractionError) -> dict[str, str]:
    facts = {
        "type": type(error).__name__,
        "message": error.message,
        "hint": error.hint,
        "arm_state": error.arm_state,
        "saved": error.saved,
    }
    if isinstance(error, TrialFileError):
        facts["path"], facts["reason"] = str(error.path), error.reason
    return facts


def _error_of(facts: Mapping[str, str]) -> TractionError:
    if facts["type"] == TrialFileError.__name__:
        return TrialFileError(Path(facts["path"]), facts["reason"], hint=facts["hint"])
    found = getattr(errors, facts["type"], DeviceFaultError)
    kind = found if issubclass(found, TractionError) else DeviceFaultError
    return kind(
        facts["message"],
        hint=facts["hint"],
        arm_state=facts["arm_state"],
        saved=facts["saved"],
    )
