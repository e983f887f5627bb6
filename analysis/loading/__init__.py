"""Recordings loaded as presses in SI units, their drift removed."""
