"""The simulated devices: motor controllers and DAQ card, by their own protocols."""
