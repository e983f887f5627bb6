"""The rigid-body engine: pymunk bodies, leap-frog steps."""

from sautereau.rig.errors import require

require("stand-in", "the stand-in's rigid-body engine", "pymunk")
