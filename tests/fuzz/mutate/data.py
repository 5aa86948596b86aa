"""Mutations of bytes, without knowledge of their format."""

from collections.abc import Callable

import numpy as np

from tests.fuzz.mutate.numbers import packed


def flipped(data: bytes, rng: np.random.Generator) -> bytes:
    """Flips a bit."""
    damaged = bytearray(data)
    damaged[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
    return bytes(damaged)


def cut(data: bytes, rng: np.random.Generator) -> bytes:
    """Cuts the end off."""
    return data[: rng.integers(len(data))]


def garbage(data: bytes, rng: np.random.Generator) -> bytes:
    """Overwrites up to 512 bytes with random ones."""
    size = int(rng.integers(1, min(513, len(data) + 1)))
    start = int(rng.integers(len(data) - size + 1))
    return data[:start] + rng.bytes(size) + data[start + size :]


def zeroed(data: bytes, rng: np.random.Generator) -> bytes:
    """Overwrites a block with zeros, as a disk leaves a block that it never wrote."""
    size = min(4096, len(data) // 2)
    start = int(rng.integers(len(data) - size + 1))
    return data[:start] + bytes(size) + data[start + size :]


def removed(data: bytes, rng: np.random.Generator) -> bytes:
    """Removes some bytes."""
    size = int(rng.integers(1, min(65, len(data) + 1)))
    start = int(rng.integers(len(data) - size + 1))
    return data[:start] + data[start + size :]


def doubled(data: bytes, rng: np.random.Generator) -> bytes:
    """Doubles some bytes."""
    size = int(rng.integers(1, min(65, len(data) + 1)))
    start = int(rng.integers(len(data) - size + 1))
    return data[: start + size] + data[start:]


def numbered(data: bytes, rng: np.random.Generator) -> bytes:
    """Overwrites some bytes with an extreme number."""
    new = packed(rng)
    start = int(rng.integers(max(1, len(data) - len(new) + 1)))
    return data[:start] + new + data[start + len(new) :]


OPERATORS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    *(flipped, cut, garbage, zeroed, removed, doubled, numbered),
)


def mutated(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns data with one mutation, and its name; empty data stay."""
    if not data:
        return data, "empty"
    operator = OPERATORS[rng.integers(len(OPERATORS))]
    return operator(data, rng), operator.__name__
