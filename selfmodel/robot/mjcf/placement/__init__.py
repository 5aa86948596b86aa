"""Placement of a robot in its world: base, initial pose, forward direction, ground."""
