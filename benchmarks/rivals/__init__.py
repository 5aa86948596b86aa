"""Other methods of recovery on the same physical robots, and an oracle."""
