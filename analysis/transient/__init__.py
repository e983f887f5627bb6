"""The transient phase of a press: its damped modes, and to which part of the bench they belong."""
