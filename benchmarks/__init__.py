"""Measurements of speed, memory and results."""
