"""Calibration of robots with a floating base."""
