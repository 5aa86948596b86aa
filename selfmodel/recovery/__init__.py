"""The recovery loop: repair EA, choice of the next trial, database and journal."""
