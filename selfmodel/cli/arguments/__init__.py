"""Arguments that commands share, and their checks."""
