"""The bench in numbers: every quantity, its unit, default and source."""
