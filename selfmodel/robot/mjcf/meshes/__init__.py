"""Meshes of an MJCF: visual assets, convex hulls and stand-ins for missing files."""
