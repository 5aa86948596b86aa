"""The number of threads of a simulation."""

import os


def thread_count(requested: int) -> int:
    """Returns the number of threads to use: ``requested``, or all processors where it is 0."""
    return requested or len(os.sched_getaffinity(0))
