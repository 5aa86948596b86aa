"""Unitree Go1 that walks by a public policy: diagnosis, false alarms, recovery; its network."""
