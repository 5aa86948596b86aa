"""A calibration of less than a second, for promises that need some fitted model."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from selfmodel.simulation import fit


@contextmanager
def coarse() -> Iterator[None]:
    """Calibrates robots with contacts with fewer candidates and iterations, in this process."""
    few = {"mu_min": 1e-3, "mu_max": 10.0, "mu_factor": 100.0}  # each takes a simulation
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "FLOATING", replace(fit.FLOATING, iterations=1, regularizers=few))
        patch.setattr(fit, "CANDIDATE_STIFFNESSES", (1.0,))
        patch.setattr(fit, "CANDIDATE_DAMPINGS", (0.5, 1.0))
        yield
