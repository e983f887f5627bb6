"""The clock of a stand-in for an ODrive that waits for the host, see docs/decisions/0006."""

from sautereau.robot.drivers.odrive.line import OdriveLine


class HostTime:
    """Simulated time, which advances only while the host waits.

    Args:
        line: To the stand-in.
    """

    def __init__(self, line: OdriveLine):
        self._line, self._now = line, 0.0

    @staticmethod
    def is_kept_by(identity: str) -> bool:
        """Whether the identity of a controller names such a stand-in."""
        return "SIM" in identity and "stepped" in identity

    def clock(self) -> float:
        """Return the seconds waited so far."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Advance the stand-in's time by seconds."""
        self._line.ask(f"w stand_in.wait {seconds:.9f}")
        self._now += seconds
