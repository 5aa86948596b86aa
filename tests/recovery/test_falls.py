"""A rollout that ends at a fall ends the same runs as its whole trajectory tells, while it runs."""

import numpy as np
import pytest

from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.recovery.falls import FALLEN_TIME, fallen, falls_of, steps_of
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import UNTIL_EVERY
from selfmodel.trials.trajectory import Trajectory

RUNS, STEPS = 40, 300


@pytest.mark.parametrize(("seed", "ground"), [(0, "intact"), (1, "intact"), (2, "slope=0.15")])
def test_the_same_runs_have_fallen_when_their_windows_are_over(
    quadruped: Robot, seed: int, ground: str
):
    rng, height = np.random.default_rng(seed), quadruped.standing_height
    hypothesis = parse(ground, quadruped.anatomy)
    # Around the limit of a fall: low for some steps, and tilted for others.
    walk = np.cumsum(rng.normal(0, 0.05, (RUNS, STEPS)), axis=1)
    position = np.zeros((RUNS, STEPS, 3))
    position[..., 0] = np.linspace(0, 1, STEPS)
    position[..., 2] = height * np.clip(1 + walk, 0.2, 1.5)
    position[:, 0, 2] = height
    tilt = np.cumsum(rng.normal(0, 0.08, (RUNS, STEPS)), axis=1)
    tilt[:, 0] = 0
    orientation = np.zeros((RUNS, STEPS, 4))
    orientation[..., 0], orientation[..., 1] = np.cos(tilt / 2), np.sin(tilt / 2)
    signals = {"base_position": position, "base_orientation": orientation}

    have_fallen = fallen(quadruped, [hypothesis] * RUNS)
    ended, told = np.zeros(RUNS, dtype=bool), np.zeros(STEPS // UNTIL_EVERY)
    for k in range(UNTIL_EVERY, STEPS + 1, UNTIL_EVERY):
        ended |= have_fallen({name: values[:, :k] for name, values in signals.items()})
        whole = whole_falls(quadruped, hypothesis, signals, k)
        assert np.array_equal(ended, whole)
        told[k // UNTIL_EVERY - 1] = ended.sum()

    assert 0 < told[5] < told[-1] < RUNS


def whole_falls(
    robot: Robot, hypothesis: Hypothesis, signals: dict[str, np.ndarray], k: int
) -> np.ndarray:
    """The runs that have fallen after k steps, by all of these."""
    time = np.arange(k) * robot.control_timestep
    begun = {name: values[:, :k] for name, values in signals.items()}
    falls = falls_of(robot, hypothesis, Trajectory(robot.anatomy.names, time, begun))
    return falls + steps_of(FALLEN_TIME, robot.control_timestep) <= k
