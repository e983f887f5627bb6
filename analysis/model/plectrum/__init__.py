"""One file a level of the plectrum; each maps (s, F) to the contact point and the tangent angle."""
