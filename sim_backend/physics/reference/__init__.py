"""An independent solution of a scene's equations, to which the engines are held."""
