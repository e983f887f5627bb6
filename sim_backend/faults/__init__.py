"""Fault injection: the faults of a scene's table `[faults]`, and when they occur."""
