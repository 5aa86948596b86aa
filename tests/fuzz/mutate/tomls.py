"""Mutations of TOML, line by line: values of other types, tables and keys in other places."""

import re

import numpy as np

from tests.fuzz.mutate import data as raw
from tests.fuzz.mutate.numbers import number, number_text, text

ENTRY = re.compile(r"(\s*[^=\[]+?\s*=\s*)(.*)")
LITERALS = (
    *("true", "1979-05-27T07:32:00Z", "07:32:00", "[]", "{}", "[1, 2]", '["a", "a"]', '""', "''"),
    *("0x7fffffffffffffff", "1e400", "-inf", "nan", "+1", "9" * 5000, '"""a\nb"""', "[[[[1]]]]"),
    *("{ name = 1 }", '{ name = "LHX", sign = 0 }', '{ name = "LHX", sign = -1, offset = 1e300 }'),
    *('{ name = "LHX", extra = 1 }', "[" * 2000 + "]" * 2000, '["' + '", "'.join("abc") + '"]'),
)


LINES = (
    *('clock = "log"', 'clock = "header"', 'stage = "before"', "start = 0.02", "start = 1e14"),
    *("duration = 0.05", "duration = 1e-9", "duration = 1e14", "control_timestep = 1e-9"),
    *("control_timestep = 0.02", 'unit = "deg"', 'unit = "km"', 'frame = "recorded"', "index = 0"),
    *("index = 1e14", "threshold = -1e300", 'topic = "/odom"', 'topic = "/joint_states"'),
    *('topic = "/left_foot"', 'topic = "/imu"', 'topic = "/commands"', "[imu]", "[base]"),
    *("[touch.right_touch]", 'order = ["RHY", "RHX", "LHY", "LHX", "x"]', 'controller = "c.npz"'),
)
"""Lines of a mapping, most of them valid somewhere."""


def mutated(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    """Returns TOML with one to three mutations, and their names."""
    if rng.random() < 0.1:
        return raw.mutated(data, rng)
    lines = data.decode().split("\n")
    names = [_change(lines, rng) for _ in range(int(rng.choice([1, 1, 1, 2, 3])))]
    return "\n".join(lines).encode("utf-8", "surrogatepass"), ", ".join(names)


def _change(lines: list[str], rng: np.random.Generator) -> str:
    at = int(rng.integers(len(lines)))
    line = lines[at]
    kind = int(rng.integers(10))
    entry = ENTRY.fullmatch(line)
    if kind < 5 and entry:
        lines[at] = entry[1] + _literal(entry[2], rng)
        return f"line {at + 1}: {lines[at]:.80}"
    if kind == 5:
        lines.insert(int(rng.integers(len(lines) + 1)), line)
        return f"line {at + 1} doubled"
    if kind == 6:
        lines.insert(int(rng.integers(len(lines))), lines.pop(at))
        return f"line {at + 1} moved"
    if kind == 7 and len(lines) > 1:
        del lines[at]
        return f"line {at + 1} removed"
    if kind == 8 and rng.random() < 0.8:
        new = LINES[rng.integers(len(LINES))]
        key = new.partition("=")[0]
        # A key that the mapping has is replaced, where it stands first.
        same = [k for k, held in enumerate(lines) if held.startswith(key)]
        lines[at : at + (0 if same else 1)] = [] if same else [line, new]
        if same:
            lines[same[0]] = new
        return new
    if kind == 8:
        lines[at] = f"{_quoted(text(rng))} = {_literal('', rng)}"
        return f"line {at + 1}: {lines[at]:.80}"
    new, _ = raw.mutated(line.encode() or b"x", rng)
    lines[at] = new.decode("utf-8", "surrogateescape").encode("utf-8", "replace").decode()
    return f"line {at + 1}: bytes"


def _literal(old: str, rng: np.random.Generator) -> str:
    kind = int(rng.integers(4))
    if kind == 0:
        return LITERALS[rng.integers(len(LITERALS))]
    if kind == 1:
        return _quoted(text(rng))
    if kind == 2:
        return number_text(rng)
    numbers = re.findall(r"-?\d+(?:\.\d+)?", old)
    if numbers:
        return old.replace(str(rng.choice(numbers)), repr(number(rng)), 1)
    return old.replace('"', "", 1)


def _quoted(value: str) -> str:
    plain = (c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08X}" for c in value)
    return f'"{"".join(plain)}"'
