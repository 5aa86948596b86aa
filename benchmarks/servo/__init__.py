"""Diagnoses of a real servo on a pendulum, from recordings with two gains and a lost torque."""
