"""Mutations of CDR messages: lengths, numbers and names, at their alignment."""

import struct

import numpy as np

from tests.fuzz.mutate import data as raw
from tests.fuzz.mutate.numbers import FLOATS, INTEGERS


def mutated(payload: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns a message with one mutation, and its name."""
    kind = int(rng.integers(6))
    if kind < 2 and len(payload) >= 12:
        # CDR aligns to the end of the four bytes of encapsulation.
        at = 4 + 8 * int(rng.integers((len(payload) - 4) // 8))
        new = struct.pack("<d", FLOATS[rng.integers(len(FLOATS))])
        return payload[:at] + new + payload[at + 8 :], f"float at {at}"
    if kind == 2 and len(payload) >= 8:
        at = 4 + 4 * int(rng.integers((len(payload) - 4) // 4))
        new = (INTEGERS[rng.integers(len(INTEGERS))] % 2**32).to_bytes(4, "little")
        return payload[:at] + new + payload[at + 4 :], f"integer at {at}"
    if kind == 3:
        return payload + bytes(int(rng.integers(1, 20))), "longer"
    if kind == 4:
        heads = (b"\x00\x00\x00\x00", b"\x00\x03\x00\x00", b"\x00\x01\x00\x01", b"")
        return heads[rng.integers(len(heads))] + payload[4:], "other encapsulation"
    return raw.mutated(payload, rng)
