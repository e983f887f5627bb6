"""An independent solution of a scene's equations, the reference for the engines' errors."""
