"""The robot and its environment: model, faults, gap, gait and motion."""
