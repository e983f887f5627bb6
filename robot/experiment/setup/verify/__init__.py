"""The first day with a real controller: what the reference leaves open is measured, and stored."""
