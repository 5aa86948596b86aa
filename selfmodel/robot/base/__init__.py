"""Base of a robot: its root body, and how that body moves."""
