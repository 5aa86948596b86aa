"""Measurements of speed, memory and results; each says what it measures and how."""
