"""Extreme scenes."""
