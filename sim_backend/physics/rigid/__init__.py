"""The rigid-body engine: pymunk bodies, leap-frog steps."""
