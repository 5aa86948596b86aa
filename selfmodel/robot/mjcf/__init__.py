"""Conversion of any MJCF file to a robot."""
