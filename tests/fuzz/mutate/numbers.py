"""Extreme numbers and texts, which mutations put in place of a value."""

import struct

import numpy as np

FLOATS = (
    *(0.0, -0.0, 1.0, -1.0, 0.5, 1e-9, 1e-300, 5e-324, 1e6, 1e9, 1e15, 1e30, 1e155, 1e300),
    *(1.7976931348623157e308, -1e308, -1e9, float("inf"), float("-inf"), float("nan")),
)
INTEGERS = (
    *(0, 1, -1, 2, 3, 7, 100, 1000, 10_001, 65_535, 10**6, 10**7, 2**31 - 1, 2**31, -(2**31)),
    *(2**32, 10**12, 2**53 + 1, 2**62, 2**63 - 1, 2**63, -(2**63), 2**64 - 1, 2**64, 10**30),
)
NUMBER_TEXTS = (
    *("0", "-0", "-1", "1e400", "-1e400", "1e-400", "nan", "NaN", "inf", "-inf", "Infinity", "1_0"),
    *("0x10", " 1 ", "1\n", "+1", "1.", ".5", "1e", "--1", "1,5", "1/2", "true", ""),
    *("\u0663", "\uff11", "\u00b2"),  # an Arabic and a wide digit, which int() reads; a power
    *("9" * 40, "9" * 5000, "0." + "0" * 400 + "1", "1e99999", "1" + "0" * 400),
)
TEXTS = (
    *("", " ", "\n", "a\nb", "\t", "\r", "\x00", "\x1b[31m", "\x7f", "\u2028", "\u202e", "é", "🤖"),
    *("a" * 200, "x" * 5000, "../..", "/etc/passwd", "C:\\x", "%s%n", "{0}", "'", '"', "\\"),
    *(
        "[red]",
        "all",
        "none",
        "None",
        "intact",
        "True",
        "null",
        "[]",
        "{}",
        "a,b",
        "a:b",
        "a=b",
        "a+b",
    ),
)


def number(rng: np.random.Generator) -> float | int:
    """Returns an extreme number, a random one, or a small one."""
    kind = rng.integers(4)
    if kind == 0:
        return FLOATS[rng.integers(len(FLOATS))]
    if kind == 1:
        return INTEGERS[rng.integers(len(INTEGERS))]
    if kind == 2:
        return float(rng.normal() * 10.0 ** rng.integers(-6, 7))
    return int(rng.integers(-3, 20))


def number_text(rng: np.random.Generator) -> str:
    """Returns a number as text, or what resembles one."""
    if rng.random() < 0.4:
        return NUMBER_TEXTS[rng.integers(len(NUMBER_TEXTS))]
    return repr(number(rng))


def text(rng: np.random.Generator) -> str:
    """Returns an unusual text."""
    if rng.random() < 0.3:
        return number_text(rng)
    return TEXTS[rng.integers(len(TEXTS))]


def near(value: float, rng: np.random.Generator) -> float:
    """Returns a number near another one, of its type."""
    step = int(rng.integers(1, 4)) * (1 if rng.random() < 0.5 else -1)
    if isinstance(value, int):
        return value + step
    return value * (1 + step * 1e-3)


def packed(rng: np.random.Generator) -> bytes:
    """Returns an extreme number in 1, 2, 4 or 8 bytes, little-endian."""
    if rng.random() < 0.5:
        return struct.pack("<d", FLOATS[rng.integers(len(FLOATS))])
    size = int(rng.choice([1, 2, 4, 8]))
    value = INTEGERS[rng.integers(len(INTEGERS))]
    return (value % 2 ** (8 * size)).to_bytes(size, "little")
