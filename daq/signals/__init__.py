"""Sensor signals: calibration, delays, quality flags."""
