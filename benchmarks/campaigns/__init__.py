"""Studies on several executors: the same table, the speed of two workers, and kills on the way."""
