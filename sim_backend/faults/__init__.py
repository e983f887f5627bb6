"""Faults on demand: what a scene's table `[faults]` lets go wrong, and when."""
