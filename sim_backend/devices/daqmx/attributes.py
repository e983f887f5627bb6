"""Properties by number: how each one is read, set and reset, and the calls that do it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sautereau.sim_backend.devices.daqmx.card import DaqmxError, ServerGone, invalid

KINDS = (
    "Bool",
    "Bytes",
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
    return {number(prefix, name): stored(prefix, name, value) for name, value in defaults.items()}


def stored(
    prefix: str,
    name: str,
    default: Any,
    possible: Callable[[Any], tuple[Any, ...]] | None = None,
    check: Callable[[Any], None] = lambda about: None,
) -> Attribute:
    """Return a property that is kept as it was set.

    Args:
        prefix: As of `table`.
        default: Before it is set, or a function of what has it.
        possible: Returns the values that a channel can have, while its task does not run.
        check: Refuses the property itself.
    """
    key = number(prefix, name)

    def read(about: Any) -> Any:
        check(about)
        if key in about.stored:
            return about.stored[key]
        return default(about) if callable(default) else default

    def write(about: Any, value: Any) -> None:
        check(about)
        if possible is not None:
            about.must_be_idle()
            if value not in (values := possible(about)):
                raise invalid(name, value, f"one of {list(values)}", about.input)
        about.stored[key] = value

    return Attribute(read, write, lambda about: about.stored.pop(key, None))


def given(request: Any, name: str) -> Any:
    """Return a field of a request; that of an enumeration may be sent as its bare number."""
    return getattr(request, f"{name}_raw", 0) or getattr(request, name, None)


def field(
    name: str,
    default: Any,
    read: Callable[[Any], Any] | None = None,
    *,
    of: Callable[[Any], Any] = lambda about: about,
) -> Attribute:
    """Return a property that is a field, which cannot be set while the task runs.

    Args:
        read: Returns the property; None for the field itself.
        of: Returns what has the field, by default what has the property.
    """

    def write(about: Any, value: Any) -> None:
        about.must_be_idle()
        setattr(of(about), name, value)

    read = read or (lambda about: getattr(of(about), name))
    return Attribute(read, write, lambda about: write(about, default))


def call(method: Callable[..., Any], name: str = "") -> Callable[..., Any]:
    """Answer a call with the fields that a method returns, None for none, or its message.

    A `DaqmxError` is answered the way the real server answers the driver's errors. A server that
    is gone answers every call as gRPC does where nobody listens.

    Args:
        method: Carries out the call; with the arguments of the servicer's methods.
        name: Of the call in nidaqmx.proto; by default the method's own.
    """
    response = getattr(pb, f"{name or method.__name__}Response")
    known = response.DESCRIPTOR.fields_by_name

    @wraps(method)
    def answer(self: Any, request: Any, context: grpc.ServicerContext) -> Any:
        if self._gone:
            context.abort(grpc.StatusCode.UNAVAILABLE, _GONE)
        try:
            found = method(self, request, context)
            if isinstance(found, response):
                return found
            raw = {key: f"{key}_raw" if f"{key}_raw" in known else key for key in found or {}}
            return response(**{raw[key]: value for key, value in (found or {}).items()})
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
    key = given(request, "attribute")
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
    """

    def each(self: Any, request: Any) -> list[Any]:
        about = find(self, request)
        return about if isinstance(about, list) else [about]

    def get(self: Any, request: Any, context: Any) -> dict[str, Any]:
        attribute = _look_up(attributes, request)
        return {"value": _only([attribute.read(one) for one in each(self, request)])}

    def set_(self: Any, request: Any, context: Any) -> None:
        attribute = _look_up(attributes, request)
        if attribute.write is None:
            raise DaqmxError(-200231, "Specified property cannot be set.")
        for one in each(self, request):
            attribute.write(one, given(request, "value"))

    def reset(self: Any, request: Any, context: Any) -> None:
        attribute = _look_up(attributes, request)
        if attribute.clear is None:
            raise DaqmxError(-200236, "Specified property cannot be reset.")
        for one in each(self, request):
            attribute.clear(one)

    named = {f"Reset{subject}Attribute": reset}
    for kind in KINDS:
        named |= {f"Get{subject}Attribute{kind}": get, f"Set{subject}Attribute{kind}": set_}
    return {
        name: call(method, name) for name, method in named.items() if hasattr(pb, f"{name}Response")
    }
