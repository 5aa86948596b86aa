"""Resampling of a recording at the control steps, in the model's units and frame."""
