"""Limit of the control delay, in a file that needs no MuJoCo."""

MAX_CONTROL_DELAY = 5
"""Largest control delay, in control steps: segments contain that many commands before their
start."""
