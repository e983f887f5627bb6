"""The outline of a plectrum in a photograph: contour, scale, clamp and tilt, with an ensemble."""
