"""Identification of unknown parameters of the bench from recorded presses."""
