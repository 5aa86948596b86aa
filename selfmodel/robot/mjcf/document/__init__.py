"""MJCF document: its files, its explicit elements, and their names and frames."""
