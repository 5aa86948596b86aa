"""MuJoCo's state of a robot: signals and sensor readings."""
