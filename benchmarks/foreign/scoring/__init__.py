"""Diagnoses of recordings by the command line of selfmodel, and the rates of right answers."""
