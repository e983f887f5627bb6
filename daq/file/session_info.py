"""Description of the press that a recording holds."""

from dataclasses import dataclass, fields

from sautereau.daq.errors import RecordingError

_BEFORE_SESSIONS = {"session": "", "item": "", "warm_up": "false"}
"""Metadata of a recording that was made before sessions had plans."""


@dataclass(frozen=True)
class SessionInfo:
    """One press of a session."""

    press: int
    """Number of the press in its session, from 1."""
    started: str
    """Date of the start of the press, ISO 8601 with the time zone."""
    simulated: bool
    """Whether the stand-in made the samples, as the DAQ device itself reports."""
    controller: str
    """Identification of the motor controller."""
    daq: str
    """Product type and serial number of the DAQ device."""
    scene: str = ""
    """Text of the stand-in's scene; empty on the hardware."""
    seed: int | None = None
    """Seed of every random number; None without one."""
    notes: str = ""
    """The operator's notes."""
    session: str = ""
    """Identifier of the session; empty for a single press."""
    item: int | None = None
    """Number of the press in the session's plan, from 1; None without a plan."""
    warm_up: bool = False
    """Whether it is a warm-up press, which is excluded from all results."""

    def to_metadata(self) -> dict[str, str]:
        """Return the fields as text, for a Metadata record."""
        return {field.name: _text(getattr(self, field.name)) for field in fields(self)}


def _text(value: str | int | bool | None) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else str(value)


def session_from_metadata(metadata: dict[str, str]) -> SessionInfo:
    """Read back what `SessionInfo.to_metadata` wrote.

    Raises:
        RecordingError: A field is missing or invalid.
    """
    known = _BEFORE_SESSIONS | metadata
    missing = [field.name for field in fields(SessionInfo) if field.name not in known]
    if missing:
        raise RecordingError(f"its session metadata lack {', '.join(missing)}")
    for flag in ("simulated", "warm_up"):
        if known[flag] not in ("true", "false"):
            raise RecordingError(f"its session says {flag} = {known[flag]!r}, not true or false")
    try:
        press = int(known["press"])
        seed, item = (int(known[name]) if known[name] else None for name in ("seed", "item"))
    except ValueError as error:
        raise RecordingError(
            f"press, seed or item of its session is not a number: {error}"
        ) from error
    return SessionInfo(
        press=press,
        started=known["started"],
        simulated=known["simulated"] == "true",
        controller=known["controller"],
        daq=known["daq"],
        scene=known["scene"],
        seed=seed,
        notes=known["notes"],
        session=known["session"],
        item=item,
        warm_up=known["warm_up"] == "true",
    )
