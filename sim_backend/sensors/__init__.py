"""The simulated sensors: from the motion of the bench to volts at the terminal block."""
