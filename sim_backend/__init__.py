"""The stand-in for robot, instrument and DAQ card."""
