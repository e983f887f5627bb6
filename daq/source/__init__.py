"""Acquisition with NI-DAQmx."""
