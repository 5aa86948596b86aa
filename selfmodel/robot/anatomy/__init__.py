"""Anatomy of a robot: its parts by name, how motors move them, and what they reach."""
