"""Damaged bytes, of any file: what disks, cables and crashes make of it."""

import random

from hypothesis import strategies as st

KINDS = ("flips", "cut", "garbage", "zeros", "lost", "twice", "swapped")


def damaged(data: bytes) -> st.SearchStrategy[bytes]:
    """Returns a strategy of damaged forms of a file."""
    return st.integers(0, 2**63).map(lambda seed: spoilt(data, random.Random(seed)))  # noqa: S311 - no secret


def spoilt(data: bytes, rng: random.Random) -> bytes:
    """Returns one damaged form of a file."""
    kind = rng.choice(KINDS)
    if kind == "flips":
        content = bytearray(data)
        for _ in range(rng.randint(1, 3)):
            content[rng.randrange(len(data))] ^= 1 << rng.randint(0, 7)
        return bytes(content)
    first, second = sorted((rng.randrange(len(data)), rng.randrange(len(data))))
    end = min(first + rng.randint(1, 600), second + 1)
    others = {
        "cut": b"",
        "garbage": rng.randbytes(rng.randint(1, 99)) + data[end:],
        "zeros": bytes(end - first) + data[end:],
        "lost": data[end:],
        "twice": data[first:end] + data[first:],
        "swapped": data[second:] + data[end:second] + data[first:end],
    }
    return data[:first] + others[kind]
