"""Properties by number: how each one is read, set and reset, and the calls that do it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, Protocol

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sautereau.sim_backend.devices.daqmx.card import ServerGone
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError

KINDS = (
    "Bool",
    "Double",
    "DoubleArray",
    "Int32",
    "Int32Array",
    "String",
    "UInt32",
    "UInt32Array",
    "UInt64",
)
_GONE = "Socket closed"


class Storing(Protocol):
    """What has properties that nothing computes."""

    stored: dict[int, Any]


@dataclass(frozen=True)
class Attribute:
    """One property; without ``write`` it cannot be set, without ``clear`` not be reset."""

    read: Callable[[Any], Any]
    write: Callable[[Any, Any], None] | None = None
    clear: Callable[[Any], None] | None = None


Table = dict[int, Attribute]


def number(prefix: str, name: str) -> int:
    """Return the number of a property by its name in nidaqmx.proto."""
    return getattr(pb, f"{prefix}_ATTRIBUTE_{name}")


def table(prefix: str, attributes: dict[str, Any]) -> Table:
    """Return properties by number.

    Args:
        prefix: Of the names in nidaqmx.proto: ``CHANNEL``.
        attributes: By name: an `Attribute`, a function that reads it, or the constant that it is.
    """
    found = {}
    for name, given in attributes.items():
        if not isinstance(given, Attribute):
            given = Attribute(given if callable(given) else lambda _, value=given: value)
        found[number(prefix, name)] = given
    return found


def kept(prefix: str, defaults: dict[str, Any]) -> Table:
    """Return properties that are kept as they were set, by name with what they are before.

    A default may be a function of what has the property.
    """
    found = {}
    for name, default in defaults.items():
        key = number(prefix, name)

        def read(subject: Storing, key=key, default=default) -> Any:
            if key in subject.stored:
                return subject.stored[key]
            return default(subject) if callable(default) else default

        def write(subject: Storing, value: Any, key=key) -> None:
            subject.stored[key] = value

        def clear(subject: Storing, key=key) -> None:
            subject.stored.pop(key, None)

        found[key] = Attribute(read, write, clear)
    return found


def call(method: Callable[..., Any]) -> Callable[..., Any]:
    """Answer a `DaqmxError` the way the real server answers the driver's errors.

    A server that is gone answers every call as gRPC does where nobody listens.
    """

    @wraps(method)
    def answer(self: Any, request: Any, context: grpc.ServicerContext) -> Any:
        if self._gone:
            context.abort(grpc.StatusCode.UNAVAILABLE, _GONE)
        try:
            return method(self, request, context)
        except ServerGone:
            self._gone = True
            context.abort(grpc.StatusCode.UNAVAILABLE, _GONE)
        except DaqmxError as fault:
            refuse(fault, context)

    return answer


def refuse(fault: DaqmxError, context: grpc.ServicerContext) -> None:
    """End a call with the driver's error."""
    trailer = [("ni-error", str(fault.code))]
    if fault.samples_read is not None:
        trailer.append(("ni-samps-per-chan-read", str(fault.samples_read)))
    context.set_trailing_metadata(tuple(trailer))
    context.abort(grpc.StatusCode.UNKNOWN, str(fault))


def _look_up(table: Table, request: Any) -> Attribute:
    key = request.attribute_raw or request.attribute
    if key not in table:
        raise DaqmxError(-200197, f"Property {key:#x} is not supported by the stand-in.")
    return table[key]


def _only(values: list[Any]) -> Any:
    """Return the value that several channels have in common."""
    if any(value != values[0] for value in values[1:]):
        raise DaqmxError(-200428, "The channels' values differ; ask for one channel at a time.")
    return values[0]


def calls(
    subject: str, find: Callable[[Any, Any], Any], attributes: Table
) -> dict[str, Callable[..., Any]]:
    """Return the calls that read, set and reset the properties of a subject.

    Args:
        subject: As in the calls' names: ``Chan`` in GetChanAttributeDouble.
        find: Returns what a request is about: one object, or a list for several channels.
        attributes: Of the subject.
    """
    found: dict[str, Callable[..., Any]] = {}

    def each(self: Any, request: Any) -> list[Any]:
        about = find(self, request)
        return about if isinstance(about, list) else [about]

    for kind in KINDS:
        for verb in ("Get", "Set"):
            name = f"{verb}{subject}Attribute{kind}"
            response = getattr(pb, f"{name}Response", None)
            if response is None:
                continue
            field = "value_raw" if "value_raw" in response.DESCRIPTOR.fields_by_name else "value"

            def get(self, request, context, response=response, field=field):
                attribute = _look_up(attributes, request)
                value = _only([attribute.read(one) for one in each(self, request)])
                return response(**{field: value})

            def set_(self, request, context, response=response):
                attribute = _look_up(attributes, request)
                if attribute.write is None:
                    raise DaqmxError(-200231, "Specified property cannot be set.")
                value = getattr(request, "value_raw", None) or request.value
                for one in each(self, request):
                    attribute.write(one, value)
                return response()

            found[name] = call(get if verb == "Get" else set_)
    reset_response = getattr(pb, f"Reset{subject}AttributeResponse", None)
    if reset_response is not None:

        def reset(self, request, context):
            attribute = _look_up(attributes, request)
            if attribute.clear is None:
                raise DaqmxError(-200236, "Specified property cannot be reset.")
            for one in each(self, request):
                attribute.clear(one)
            return reset_response()

        found[f"Reset{subject}Attribute"] = call(reset)
    return found
