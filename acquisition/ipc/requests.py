"""Requests between processes: typed messages as JSON over a `Channel`, never pickled.

Both ends block, so the thread of the control loop never uses them: the control process
answers only before its loop starts and after it ends.

A request is a dataclass whose fields are sent; a `Request[X]` has an answer of type X.
A `Dispatcher` maps the requests that a process answers to functions. Fields and answers
are validated against their types on both sides.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar, get_args

from pydantic import ConfigDict, TypeAdapter, ValidationError

from acquisition import errors
from acquisition.errors import DeviceFaultError, TractionError, TrialFileError
from acquisition.ipc.channel import Channel

Answer = TypeVar("Answer")
_SENT = TypeAdapter(tuple[str, dict[str, Any]])  # name of a request, its fields
Handlers = Mapping[type["Request[Any]"], Callable[..., object]]


class RequestError(TractionError):
    """An unknown request, or one with invalid fields."""


class Request(Generic[Answer]):
    """Base of requests to another process; subclasses are frozen dataclasses."""

    __slots__ = ()
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")


class Dispatcher:
    """Table of the requests that a process answers, with their functions."""

    def __init__(self, *tables: Handlers) -> None:
        """Merge tables.

        Args:
            tables: functions by request class; each takes the fields of its request in
                order.

        Raises:
            ValueError: two requests have the same name.
        """
        self._handlers: dict[str, tuple[type[Request[Any]], Callable[..., Any]]] = {}
        for request, handler in (row for table in tables for row in table.items()):
            if request.__name__ in self._handlers:
                raise ValueError(f"offered twice: {request.__name__}")
            self._handlers[request.__name__] = request, handler

    def carry_out(self, request: Request[Answer]) -> Answer:
        """Execute a request of this process and return the answer.

        Raises:
            RequestError: the request is not in the table.
        """
        _, handler = self._row(type(request).__name__)
        return handler(*_values_of(request))

    def answer(self, channel: Channel) -> None:
        """Wait for one request and send the answer or a TractionError.

        Raises:
            ChannelClosedError: the peer has closed the channel.
        """
        sent = channel.receive()
        try:
            value, error = self._answer(sent), None
        except TractionError as raised:
            value, error = None, _encode_error(raised)
        channel.send({"value": value, "error": error})

    def _answer(self, sent: object) -> object:
        """Execute a received request; return the answer as a JSON value."""
        try:
            name, values = _SENT.validate_python(sent)
            kind, handler = self._row(name)
            request = _adapter(kind).validate_python(values)
        except ValidationError as error:
            raise RequestError(f"A request has wrong fields: {error}") from error
        value = handler(*_values_of(request))
        return _answer_adapter(kind).dump_python(value, mode="json")

    def _row(self, name: str) -> tuple[type[Request[Any]], Callable[..., Any]]:
        if name not in self._handlers:
            raise RequestError(f"{name!r} is not answered by this process.")
        return self._handlers[name]


def ask(
    channel: Channel, request: Request[Answer], seconds: float | None = None
) -> Answer:
    """Send a request to the `Dispatcher` behind `channel` and return the answer.

    Args:
        channel: channel to the peer.
        request: the request.
        seconds: longest time to wait for the answer; None = no limit.

    Raises:
        TractionError: raised by the peer.
        ChannelClosedError: the peer has closed the channel.
        TimeoutError: no answer within `seconds`.
    """
    kind = type(request)
    channel.send([kind.__name__, _adapter(kind).dump_python(request, mode="json")])
    if seconds is not None and not channel.is_readable(seconds):
        raise TimeoutError
    answer = channel.receive()
    if answer["error"] is not None:
        raise _decode_error(answer["error"])
    return _answer_adapter(kind).validate_python(answer["value"])


def _values_of(request: Any) -> list[Any]:  # noqa: ANN401 - any dataclass
    return [getattr(request, field.name) for field in fields(request)]


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:  # noqa: ANN401 - any type
    return TypeAdapter[Any](kind)


def _answer_adapter(kind: type[Request[Any]]) -> TypeAdapter[Any]:
    """Return the adapter for the answer type X of a `Request[X]`."""
    (base,) = kind.__orig_bases__  # pyright: ignore[reportAttributeAccessIssue, reportUnknownMemberType, reportUnknownVariableType]
    return _adapter(get_args(base)[0])


def _encode_error(error: TractionError) -> dict[str, str]:
    fields = {
        "type": type(error).__name__,
        "message": error.message,
        "hint": error.hint,
        "arm_state": error.arm_state,
        "saved": error.saved,
    }
    if isinstance(error, TrialFileError):
        fields["path"], fields["reason"] = str(error.path), error.reason
    return fields


def _decode_error(fields: Mapping[str, str]) -> TractionError:
    if fields["type"] == TrialFileError.__name__:
        return TrialFileError(
            Path(fields["path"]), fields["reason"], hint=fields["hint"]
        )
    kind = getattr(errors, fields["type"], DeviceFaultError)
    if fields["type"] == RequestError.__name__:
        kind = RequestError
    elif not issubclass(kind, TractionError):
        kind = DeviceFaultError
    return kind(
        fields["message"],
        hint=fields["hint"],
        arm_state=fields["arm_state"],
        saved=fields["saved"],
    )
