"""Thousands of presses at once: from a folder of recordings to one table."""
