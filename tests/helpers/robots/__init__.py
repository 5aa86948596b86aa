"""Robots of the tests: models, and physical robots that stand for real ones."""
