"""Watches of robots of the independent generator: false alarms, delays, causes, onsets, time."""
