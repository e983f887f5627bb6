"""The plucking model: plectrum, string, key and the press as a whole."""
