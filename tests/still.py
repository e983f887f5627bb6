"""An arm at rest, for emulated controllers without a scene."""


class Still:
    """Encoders of an arm at rest."""

    def __init__(self):
        self.driven = None

    def encoder_counts(self):
        return 0, 0

    def home_counts(self):
        return 1500, -700

    def torque_volts(self):
        return 0.0, 0.0

    def index(self, axis):
        return None

    def active(self, switch, axis):
        return False

    def amplifier_fault(self, axis):
        return False

    def drive(self, offsets, limits):
        self.driven = offsets, limits
