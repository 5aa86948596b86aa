"""Recoveries of simulated physical robots, measured against an oracle."""
