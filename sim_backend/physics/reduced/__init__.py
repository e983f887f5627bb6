"""The reduced engine: one equation of the key, for a push or an ideal finger; compiled."""
