"""What a recording says of the press it holds, beside the samples."""

from dataclasses import dataclass, fields

from daq.errors import RecordingError


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
    """TOML text of the stand-in's scene; empty on the hardware."""
    seed: int | None = None
    """Of every random number; None without one."""
    notes: str = ""
    """The operator's."""

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
        }


def session_from_metadata(metadata: dict[str, str]) -> SessionInfo:
    """Read back what `SessionInfo.to_metadata` wrote.

    Raises:
        RecordingError: A field is missing or has no sense; the flag `simulated` above all.
    """
    missing = [field.name for field in fields(SessionInfo) if field.name not in metadata]
    if missing:
        raise RecordingError(f"its session metadata lacks {', '.join(missing)}")
    if metadata["simulated"] not in ("true", "false"):
        raise RecordingError(
            f"its session says simulated = {metadata['simulated']!r}, not true or false"
        )
    try:
        press = int(metadata["press"])
        seed = int(metadata["seed"]) if metadata["seed"] else None
    except ValueError as error:
        raise RecordingError(f"its session's press or seed is no number: {error}") from error
    return SessionInfo(
        press=press,
        started=metadata["started"],
        simulated=metadata["simulated"] == "true",
        controller=metadata["controller"],
        daq=metadata["daq"],
        scene=metadata["scene"],
        seed=seed,
        notes=metadata["notes"],
    )
