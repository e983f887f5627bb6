"""Levels of the plectrum, one file each: maps of (s, F) to the contact point and tangent angle."""
