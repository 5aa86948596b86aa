"""Calibration and diagnosis of a real robot: a Unitree Go2 on a stand, from 15 s of its log."""
