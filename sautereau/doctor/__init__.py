"""Checks of this machine: what is installed, connected and missing."""
