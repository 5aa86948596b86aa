"""Warnings of libraries as counted sentences on standard error, at the end of a command."""

import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_notes

MUJOCO_LOG = "selfmodel.robot.mujoco_errors"
"""Module that counts MuJoCo's warnings; it is not imported by a command without MuJoCo."""


@contextmanager
def counted_warnings() -> Iterator[None]:
    """Collects warnings during a block, and prints each once with its number after the block."""
    found: Counter[str] = Counter()

    def count(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        found[f"Python warned {{}}: {category.__name__}: {message}"] += 1

    before = _mujoco_warnings()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", RuntimeWarning)  # each occurrence, not each place
            warnings.showwarning = count
            yield
    finally:
        for text, number in _mujoco_warnings().items():
            if number > before.get(text, 0):
                found[f"MuJoCo warned {{}}: {text}"] = number - before.get(text, 0)
        for text, number in found.items():
            sentence = text.replace("{}", counted(number, "time"), 1)
            print_notes(f"note: {' '.join(sentence.split())}")


def _mujoco_warnings() -> Mapping[str, int]:
    module = sys.modules.get(MUJOCO_LOG)
    found: Mapping[str, int] = {} if module is None else module.mujoco_warnings()
    return found
