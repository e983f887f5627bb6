"""The plucking model: plectrum, string, key and the complete press."""
