"""The paper's recovery loop: repair EA, choice of the next trial, and database."""
