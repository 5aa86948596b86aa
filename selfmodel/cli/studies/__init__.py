"""Commands that run and compare studies."""
