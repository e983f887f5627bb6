"""The DAQ card: the way to its driver, its task, its faults."""
