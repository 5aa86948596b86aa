"""A robot on a bench, for the tests of what drives one: an environment of made-up observations."""

from pathlib import Path

import dm_env
import numpy as np

from selfmodel.logs.records import TrialHeader
from selfmodel.logs.writer import write_trial
from selfmodel.physical.environment import EnvironmentRobot
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory, collect
from selfmodel.trials.trial import TrialPlan
from tests.helpers.drivers import random_controllers

STEPS = 30
QUADRUPED = ROBOTS["quadruped"].robot()
(CONTROLLER,) = random_controllers(QUADRUPED, 1)
NAMES = QUADRUPED.anatomy.names
TIMESTEP = QUADRUPED.control_timestep


class Bench(dm_env.Environment):
    """A robot on a bench: what it observes at each step is made up, and so is its clock.

    Args:
        happens: By step what is other than usual: an observation, None, an exception to raise, or
            the seconds that the step takes.
    """

    def __init__(self, happens: dict[int, object] | None = None, last: int = 10**9) -> None:
        self.happens, self.last = happens or {}, last
        self.now, self.done = 100.0, []
        self.step_number = 0
        self.commands: list[np.ndarray] = []

    def reset(self) -> dm_env.TimeStep:
        """Observes step 0."""
        self.done.append("reset")
        self.step_number = 0
        return dm_env.restart(self._observe())

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Observes the next step."""
        self.done.append("step")
        self.commands.append(action)
        self.step_number += 1
        make = dm_env.termination if self.step_number == self.last else dm_env.transition
        return make(0.0, self._observe())

    def stop(self) -> None:
        """Is the safe command."""
        self.done.append("stop")

    def clock(self) -> float:
        """Tells the made-up time."""
        return self.now

    def _observe(self) -> object:
        happens = self.happens.get(self.step_number, TIMESTEP)
        if isinstance(happens, BaseException):
            raise happens
        self.now += happens if isinstance(happens, float) else TIMESTEP
        return observation(self.step_number) if isinstance(happens, float) else happens

    def action_spec(self) -> dm_env.specs.Array:
        """Returns that of the quadruped."""
        return dm_env.specs.Array((len(NAMES.motors),), float)

    def observation_spec(self) -> dict[str, dm_env.specs.Array]:
        """Returns nothing: nobody asks."""
        return {}


def observation(step: int, **changed: object) -> dict[str, object]:
    """An observation of which no two are alike."""
    rng = np.random.default_rng(step)
    rows = {signal: rng.uniform(-0.2, 0.2, NAMES.width(signal)) for signal in SIGNALS[2:]}
    orientation = rows["base_orientation"] + [1, 0, 0, 0]
    rows["base_orientation"] = orientation / np.linalg.norm(orientation)
    rows["sensors"] = rng.uniform(-1, 1, len(NAMES.sensors))
    return rows | changed


def bench_robot(bench: Bench, **options: object) -> EnvironmentRobot:
    return EnvironmentRobot(bench, QUADRUPED, stop=bench.stop, clock=bench.clock, **options)


def driven(bench: Bench, steps: int = STEPS, **options: object) -> Trajectory:
    return collect(NAMES, bench_robot(bench, **options).run(CONTROLLER, steps))


def logged(bench: Bench, folder: Path, steps: int = STEPS, **options: object) -> Path:
    physical = bench_robot(bench, **options)
    return write_trial(
        folder / "trial.mcap",
        QUADRUPED,
        TrialPlan("trial", "single", CONTROLLER, steps, 0),
        physical.run(CONTROLLER, steps),
        TrialHeader(Settings(), timed=True),
    )
