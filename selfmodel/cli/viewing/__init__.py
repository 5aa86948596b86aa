"""Viewers of other projects: Rerun, with both bodies, and Foxglove, with a layout."""
