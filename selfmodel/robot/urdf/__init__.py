"""Robots from URDF files: read, converted by MuJoCo's importer, and given motors and a stance."""
