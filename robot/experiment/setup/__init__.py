"""Setting up a bench, step by step: find its values, and write them into the rig file."""
