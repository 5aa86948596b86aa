"""The judgement of the best hypothesis: tests, numbers and verdict."""
