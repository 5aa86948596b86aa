"""Estimates from logged joint signals: noise of encoders, smoothed positions, velocities."""
