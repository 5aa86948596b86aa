"""Calibration of the joints of a robot with a fixed base."""
