"""Readers over other people's libraries, run as a program of their own: see `__main__`."""
