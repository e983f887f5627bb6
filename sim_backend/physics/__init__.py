"""Mechanics of a scene: the engines, their drives, and an independent reference."""
