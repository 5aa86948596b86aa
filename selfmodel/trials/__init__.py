"""The record of a run: its signals, its plan, and arithmetic on the signals."""
