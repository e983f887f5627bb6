"""The reduced engine: the key of a push or an ideal finger as one equation, compiled."""
