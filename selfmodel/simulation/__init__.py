"""Simulation of the self-model: rollouts, short predictions, ensembles, calibration, replay."""
