"""Repairs: searches for controllers that compensate for a failure."""
