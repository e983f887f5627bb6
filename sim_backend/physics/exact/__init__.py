"""The exact engine: the equations of docs/stand-in.md, from event to event; compiled."""
