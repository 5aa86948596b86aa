"""Comparison of the results of two versions of selfmodel to the last bit."""
