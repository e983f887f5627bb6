"""Measurements that check their results; `python -m benchmarks` rewrites docs/figures.md."""
