"""Writing of a trial log while the trial runs."""
