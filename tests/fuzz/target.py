"""What the campaign runs: targets, which make cases; a case is some files and a check of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Case:
    """One input of a target.

    Attributes:
        what: Description of the mutations, for the report.
        files: Content by path relative to the folder of the case.
        check: Runs the code under test in the folder of the case, which is the working folder, and
            returns the outcome in one word. Raises InputError or WorkError where the code refuses
            the input; any other exception is a finding.
    """

    what: str
    files: Mapping[str, bytes]
    check: Callable[[], str]


Make = Callable[[np.random.Generator], Case]
"""Function from random numbers to a case; equal numbers, equal case."""


@dataclass(frozen=True)
class Target:
    """Code that reads input of one format.

    Attributes:
        name: Name for ``--only``.
        share: Share of the campaign, relative to the other targets.
        prepare: Makes the seeds in an empty folder, once per campaign, and returns the maker of
            cases; what is imported there is not imported again for each case.
    """

    name: str
    share: int
    prepare: Callable[[Path], Make]
