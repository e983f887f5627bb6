"""Plucks on a compliant key, which bends, heaves, rings, or whose jack stands on a soft cloth."""
