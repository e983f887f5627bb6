"""The result of segmenting a press: its phases and its plucks."""

from dataclasses import dataclass


@dataclass(frozen=True)
class HeldString:
    """One pluck; times in s after the trigger."""

    contact: float
    release: float
    contact_std: float
    """s, standard uncertainty."""
    release_std: float
    """s, standard uncertainty."""
    contact_force: float
    """N, of the finger at contact."""
    release_force: float
    """N, of the finger just before release."""
    force_drop: float
    """N, fall of the finger force at release."""
    force_slope: float
    """N/m, finger force on key deflection at the laser while the string is held."""

    @property
    def pluck_duration(self) -> float:
        """Time from contact to release [s]."""
        return self.release - self.contact


@dataclass(frozen=True)
class Phases:
    """The phases of a press; times in s after the trigger."""

    start: float
    """s, at which a jack that always had its free speed would have left rest."""
    bottom: float
    """s, at which the jack has reached its full rise."""
    plucks: tuple[HeldString, ...]
    free_speed: float
    """m/s, mean of the jack before contact, after the run-up."""
    held_speed: float | None
    """m/s, mean of the jack while the first string is held; None without a pluck."""
    released_speed: float | None
    """m/s, mean of the jack after the first release, over as long a time as the string was held."""
    warnings: tuple[str, ...]
    bottomed: float | None = None
    """s, at which the key meets its front felt; None where it does not."""
    returned: float | None = None
    """s, at which the key is back at rest; None where it does not return."""
    peak_force: float | None = None
    """N, largest finger force of the complete press; None where it was not evaluated."""
