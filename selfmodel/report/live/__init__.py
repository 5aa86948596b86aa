"""A report that is served on this computer while a recovery runs."""
