"""Scores: fitness functions of controllers."""
