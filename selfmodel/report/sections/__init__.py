"""Sections of a report, one a file: each returns a ``Section`` of a subject, or None."""
