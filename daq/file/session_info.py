"""What a recording says of the press it holds, beside the samples."""

from dataclasses import dataclass, fields

from sautereau.daq.errors import RecordingError

_BEFORE_SESSIONS = {"session": "", "item": "", "warm_up": "false"}
"""Of a recording that was made before sessions had plans."""


@dataclass(frozen=True)
class SessionInfo:
    """One press of a session."""

    press: int
    """Number of the press in its session, from 1."""
    started: str
    """When the press began, ISO 8601 with the time zone."""
    simulated: bool
    """Whether the stand-in made the samples; as the DAQ device itself tells."""
    controller: str
    """How the motor controller names itself."""
    daq: str
    """Product type and serial number of the DAQ device."""
    scene: str = ""
    """Text of the stand-in's scene; empty on the hardware."""
    seed: int | None = None
    """Of every random number; None without one."""
    notes: str = ""
    """The operator's."""
    session: str = ""
    """Identity of the session that made it; empty for a press by itself."""
    item: int | None = None
    """Which press of the session's plan it is, from 1; None without a plan."""
    warm_up: bool = False
    """Whether it only warms the arm up, and counts in no figure."""

    def to_metadata(self) -> dict[str, str]:
        """Return the fields as text, for a Metadata record."""
        return {
            "press": str(self.press),
            "started": self.started,
            "simulated": "true" if self.simulated else "false",
            "controller": self.controller,
            "daq": self.daq,
            "scene": self.scene,
            "seed": "" if self.seed is None else str(self.seed),
            "notes": self.notes,
            "session": self.session,
            "item": "" if self.item is None else str(self.item),
            "warm_up": "true" if self.warm_up else "false",
        }


def session_from_metadata(metadata: dict[str, str]) -> SessionInfo:
    """Read back what `SessionInfo.to_metadata` wrote.

    Raises:
        RecordingError: A field is missing or has no sense; the flag `simulated` above all.
    """
    known = _BEFORE_SESSIONS | metadata
    missing = [field.name for field in fields(SessionInfo) if field.name not in known]
    if missing:
        raise RecordingError(f"its session metadata lacks {', '.join(missing)}")
    for flag in ("simulated", "warm_up"):
        if known[flag] not in ("true", "false"):
            raise RecordingError(f"its session says {flag} = {known[flag]!r}, not true or false")
    try:
        press = int(known["press"])
        seed, item = (int(known[name]) if known[name] else None for name in ("seed", "item"))
    except ValueError as error:
        raise RecordingError(f"its session's press, seed or item is no number: {error}") from error
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
