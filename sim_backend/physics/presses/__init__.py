"""Presses for the exact engine: a scene's parameters and force laws, and its world."""
