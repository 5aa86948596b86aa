"""Studies with a known truth, on a grid that can be continued, and their statistics."""
