"""Random streams by name: each is derived from words and a seed, and from nothing else."""

import zlib

import numpy as np


def stream(seed: int, *words: str) -> np.random.Generator:
    """Returns the generator of a stream.

    Args:
        seed: Seed of the recording.
        words: Words that name the stream, such as robot, case and purpose.
    """
    key = [zlib.crc32(word.encode()) for word in words]
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
