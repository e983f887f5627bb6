"""The accuracy that a scene may ask for instead of a step."""

from dataclasses import dataclass

from sautereau.rig.units import parse_quantity


@dataclass(frozen=True)
class Accuracy:
    """A largest error, of the times of events or of forces; one of the two is None."""

    time: float | None
    """s."""
    force: float | None
    """Dimensionless, fraction of the largest force."""

    @classmethod
    def parse(cls, text: str) -> "Accuracy":
        """Read "10 us" or "0.1 %".

        Raises:
            ValueError: It is neither a time nor a percentage, or not positive.
        """
        of_force = text.strip().endswith("%")
        value = parse_quantity(text.replace("%", "percent"), "" if of_force else "s")
        if not 0 < value < (1 if of_force else 1e-2):
            limits = "between 0 and 100 %" if of_force else "between 0 and 10 ms"
            raise ValueError(f"accuracy: {text!r} must lie {limits}; change it")
        return cls(None, value) if of_force else cls(value, None)

    def __str__(self) -> str:
        if self.time is None:
            return f"{(self.force or 0.0) * 100:.3g} %"
        return f"{self.time * 1e6:.4g} us"
