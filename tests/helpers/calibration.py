"""A calibration of less than a second, for promises that need some fitted model, and a delay."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from selfmodel.robot.robot import Robot
from selfmodel.simulation import fit
from selfmodel.simulation.model_factors import nominal, with_parameters


@contextmanager
def coarse() -> Iterator[None]:
    """Calibrates robots with contacts with fewer candidates and iterations, in this process."""
    few = {"mu_min": 1e-3, "mu_max": 10.0, "mu_factor": 100.0}  # each takes a simulation
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "FLOATING", replace(fit.FLOATING, iterations=1, regularizers=few))
        patch.setattr(fit, "CANDIDATE_STIFFNESSES", (1.0,))
        patch.setattr(fit, "CANDIDATE_DAMPINGS", (0.5, 1.0))
        yield


def late(robot: Robot, delay: float) -> Robot:
    """Returns a robot with another control delay, control steps."""
    return with_parameters(robot, replace(nominal(robot), delay=delay))
