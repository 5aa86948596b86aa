"""Prediction error of calibrated self-models on held-out trials, and the cost of calibration."""
