"""Setting up a bench, step by step: what is found, and what goes into the rig file of it."""
