"""Job of a grid: the definition of one run and the names of its parts."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Job:
    """Definition of one run.

    Attributes:
        key: Name of the run and of its folder: letters, digits, ``.``, ``_``, ``-``, ``=``, ``%``.
        parameters: All inputs of the results except the seed, as JSON.
        seed: Seed of all random numbers.
        parts: Names of the parts to run, in order; a later call may request other parts.
    """

    key: str
    parameters: Mapping[str, Any] = field(hash=False)
    seed: int
    parts: tuple[str, ...] = ("result",)

    def __post_init__(self) -> None:
        if not re.fullmatch(r"\w[\w.=%-]*", self.key, re.ASCII):
            raise ValueError(f"expected a key that is a valid folder name, got {self.key!r}")

    @property
    def definition(self) -> Mapping[str, Any]:
        """Content of the run's ``run.json``."""
        return {"key": self.key, "seed": self.seed, "parameters": dict(self.parameters)}


Work = Callable[[Job, str, Path], Any]
"""Function that runs one part of a job in the folder of its run and returns the result as JSON, or
a ``PartResult`` with the files that belong to it."""
