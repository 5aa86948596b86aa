"""Comparison of the methods of a study: its rows as outcomes, tables, figures."""
