"""Typed calls between processes: JSON over a `Channel`, never pickled.

For what happens between trials; nothing here belongs into a running loop.

A class is the contract: a `Protocol`, or the class that carries the calls out.
`make_proxy` returns an object that has its public methods and sends every call; `bind`
and `RpcServer` carry calls out on an object that has them. Arguments and results are
checked against the annotations on both sides.
"""

import base64
import inspect
import io
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator, TypeAdapter, ValidationError

from acquisition import errors
from acquisition.errors import DeviceFaultError, TractionError, TrialFileError
from acquisition.ipc.channel import Channel

Call = Callable[[str, dict[str, Any]], Any]  # method, arguments in; result out
_P = TypeVar("_P")


class RemoteCallError(TractionError):
    """A call that the other side does not offer, or not with these arguments."""


@dataclass(frozen=True, slots=True)
class RemoteMethod:
    """A method or property of a Protocol, as it is sent.

    Attributes:
        name: of the method.
        is_property: it is read, not called.
        signature: its parameters without `self`.
        arguments: what checks and converts each of them, by name.
        result: what checks and converts the result.
    """

    name: str
    is_property: bool
    signature: inspect.Signature
    arguments: Mapping[str, TypeAdapter[Any]]
    result: TypeAdapter[Any]

    def encode(self, *args: object, **kwargs: object) -> dict[str, Any]:
        """Return the arguments of a call as JSON values."""
        bound = self.signature.bind(*args, **kwargs)
        return {
            name: self.arguments[name].dump_python(value, mode="json")
            for name, value in bound.arguments.items()
        }

    def decode(self, values: object) -> dict[str, Any]:
        """Return the arguments of a call that has arrived.

        Raises:
            RemoteCallError: they are not those of the method.
        """
        try:
            given = cast("dict[str, Any]", values) if isinstance(values, dict) else None
            self.signature.bind(**(given or {}))
            if given is None:
                raise TypeError("no table of arguments")
            return {
                name: self.arguments[name].validate_python(value)
                for name, value in given.items()
            }
        except (TypeError, ValidationError) as error:
            raise RemoteCallError(
                f"{self.name} was called with wrong arguments: {error}"
            ) from error


def remote_methods(protocol: type[Any]) -> dict[str, RemoteMethod]:
    """Return the public methods and properties of `protocol`, also inherited ones."""
    methods: dict[str, RemoteMethod] = {}
    for owner in reversed(protocol.__mro__):
        for name, member in vars(owner).items():
            function = member.fget if isinstance(member, property) else member
            if name.startswith("_") or not inspect.isfunction(function):
                continue
            methods[name] = _remote_method(name, function, isinstance(member, property))
    return methods


def send_call(channel: Channel, method: str, arguments: dict[str, Any]) -> Any:  # noqa: ANN401
    """Call a method of the `RpcServer` behind `channel` and return its result.

    Raises:
        TractionError: what the other side raised.
        ChannelClosedError: the other side has gone.
    """
    channel.send([method, arguments])
    answer = channel.receive()
    if answer["error"] is not None:
        raise _decode_error(answer["error"])
    return answer["value"]


def make_proxy(
    protocol: type[_P],
    call: Call,
    local: Mapping[str, Callable[..., Any]] | None = None,
) -> _P:
    """Return an object with the methods of `protocol` whose calls are sent.

    Args:
        protocol: the contract.
        call: sends a call and returns the result, e.g. `Child.call`.
        local: methods that are answered on this side.
    """
    return cast("_P", _Proxy(remote_methods(protocol), call, local or {}))


class _Proxy:
    def __init__(
        self,
        methods: Mapping[str, RemoteMethod],
        call: Call,
        local: Mapping[str, Callable[..., Any]],
    ) -> None:
        self._methods = methods
        self._call = call
        self._local = local

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - typed by the Protocol
        if name in self._local:
            return self._local[name]
        method = self._methods.get(name)
        if method is None:
            raise AttributeError(name)
        return self._send(method) if method.is_property else partial(self._send, method)

    def _send(self, method: RemoteMethod, *args: object, **kwargs: object) -> object:
        value = self._call(method.name, method.encode(*args, **kwargs))
        return method.result.validate_python(value)


@dataclass(frozen=True, slots=True)
class BoundMethod:
    """A method of a Protocol on the object that implements it."""

    method: RemoteMethod
    implementation: object

    def __call__(self, arguments: object) -> Any:  # noqa: ANN401
        """Carry out a call and return the result as a JSON value."""
        checked = self.method.decode(arguments)
        value: Any = getattr(self.implementation, self.method.name)
        if not self.method.is_property:
            value = value(**checked)
        return self.method.result.dump_python(value, mode="json")


def bind(protocol: type[_P], implementation: _P) -> dict[str, BoundMethod]:
    """Return the methods of `protocol` on `implementation`, and nothing else of it."""
    return {
        name: BoundMethod(method, implementation)
        for name, method in remote_methods(protocol).items()
    }


class RpcServer:
    """Carries out the calls that arrive, for the methods it was given."""

    def __init__(self, *services: Mapping[str, BoundMethod]) -> None:
        self._methods: dict[str, BoundMethod] = {}
        for service in services:
            if twice := self._methods.keys() & service.keys():
                raise ValueError(f"offered twice: {', '.join(sorted(twice))}")
            self._methods.update(service)

    def answer(self, channel: Channel) -> None:
        """Wait for one call and answer it; errors a person can understand too.

        Raises:
            ChannelClosedError: the other side has gone.
        """
        name, arguments = channel.receive()
        try:
            value, error = self._carry_out(name, arguments), None
        except TractionError as raised:
            value, error = None, _encode_error(raised)
        channel.send({"value": value, "error": error})

    def _carry_out(self, name: object, arguments: object) -> Any:  # noqa: ANN401
        method = self._methods.get(name) if isinstance(name, str) else None
        if method is None:
            raise RemoteCallError(f"{name!r} is not a method of this process.")
        return method(arguments)


def _remote_method(
    name: str, function: Callable[..., Any], is_property: bool
) -> RemoteMethod:
    hints = typing.get_type_hints(function, include_extras=True)
    signature = inspect.signature(function)
    parameters = [p for key, p in signature.parameters.items() if key != "self"]
    return RemoteMethod(
        name=name,
        is_property=is_property,
        signature=signature.replace(parameters=parameters),
        arguments={p.name: _adapter(hints[p.name]) for p in parameters},
        result=_adapter(hints["return"]),
    )


def _adapter(hint: Any) -> TypeAdapter[Any]:  # noqa: ANN401
    if typing.get_origin(hint) is not np.ndarray:
        return TypeAdapter[Any](hint)
    (scalar,) = typing.get_args(typing.get_args(hint)[1])
    decode = PlainValidator(partial(_decode_array, scalar))
    return TypeAdapter[Any](Annotated[Any, PlainSerializer(_encode_array), decode])


def _encode_array(array: NDArray[Any]) -> str:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return base64.b64encode(buffer.getvalue()).decode()


def _decode_array(scalar: type[np.generic], value: object) -> NDArray[Any]:
    if not isinstance(value, str):
        raise ValueError("no array")
    try:
        buffer = io.BytesIO(base64.b64decode(value, validate=True))
        array: NDArray[Any] = np.load(buffer, allow_pickle=False)
    except EOFError as error:
        raise ValueError("no array") from error
    if not np.issubdtype(array.dtype, scalar):
        raise ValueError(f"an array of {array.dtype}, expected {scalar.__name__}")
    return array


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
    if fields["type"] == RemoteCallError.__name__:
        kind = RemoteCallError
    elif not issubclass(kind, TractionError):
        kind = DeviceFaultError
    return kind(
        fields["message"],
        hint=fields["hint"],
        arm_state=fields["arm_state"],
        saved=fields["saved"],
    )
