"""What is said first where any of the presses was made on a stand-in."""

SOME_SIMULATED = "SIMULATED: at least one of these presses was made on the stand-in"
"""The line of text."""
