"""The rig: every quantity of the bench, its unit, default and source."""
