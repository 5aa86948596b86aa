"""Edits of a robot's model: the copy that faults edit, and functions on compiled models."""
