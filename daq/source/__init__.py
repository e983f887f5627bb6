"""What measures: acquisition with NI-DAQmx."""
