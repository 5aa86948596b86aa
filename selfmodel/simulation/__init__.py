"""The self-model in motion: rollouts, short predictions, calibration, replay."""
