"""Baselines: other methods of recovery on the same physical robots, one method a file."""
