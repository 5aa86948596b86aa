"""Repertoires: many diverse gaits of one robot, one per cell of a grid of duty factors."""
