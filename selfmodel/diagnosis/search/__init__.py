"""The search for the best hypothesis: refinement, severities and surrogates."""
