"""Rigid bodies, the reduced equation and what drives them: the mechanics of a scene."""
