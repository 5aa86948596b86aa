"""Mapping from a recording to the parts of a robot: read, checked and suggested."""
