"""What was found in a press: its phases, and every string that was held."""

from dataclasses import dataclass


@dataclass(frozen=True)
class HeldString:
    """One pluck: when the string was met and let go; s from the trigger."""

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
    """N, by which it falls at release."""
    slope: float
    """N/m, of the finger's force on the key's deflection while the string is held."""

    @property
    def duration(self) -> float:
        """Time the string is held [s]."""
        return self.release - self.contact


@dataclass(frozen=True)
class Phases:
    """What a press went through; times in s from the trigger."""

    start: float
    """s, when a jack always as fast as in the free phase would have left its rest."""
    bottom: float
    """s, when the jack has come to its full rise."""
    plucks: tuple[HeldString, ...]
    free_speed: float
    """m/s, mean of the jack in the free phase, after the run-up."""
    held_speed: float | None
    """m/s, mean of the jack while the first string is held; None without a pluck."""
    released_speed: float | None
    """m/s, mean of the jack after that release, over as long a time as the string was held."""
    warnings: tuple[str, ...]
    bottomed: float | None = None
    """s, when the key meets its felt; None where it does not."""
    returned: float | None = None
    """s, when the key is back at its rest; None where it does not come back."""
