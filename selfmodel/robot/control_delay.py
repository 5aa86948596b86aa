"""Limit of the control delay, readable without MuJoCo."""

MAX_CONTROL_DELAY = 5
"""Control steps from a command to its effect, at most."""
