"""Presses for the exact engine: a scene's parameters and force laws, one world, or many presses."""
