"""Accusations of a robot that differs from its self-model, and what is doubted of them."""

import dataclasses
from collections.abc import Sequence
from functools import cache

import numpy as np

from selfmodel import load_robot
from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.controllers.playback import played_back
from selfmodel.diagnosis.adequacy import doubt_of
from selfmodel.diagnosis.diagnosis import Doubt, Fit
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.problem import Problem
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import DEFAULT_KINDS
from selfmodel.robot.robot import Robot
from selfmodel.simulation.model_factors import model_with_parameters, nominal, with_model
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.diagnosis import synthetic
from tests.helpers.drivers import random_motion
from tests.helpers.memory import trial_of

STEPS = 400
GAITS = {"first": (1.0, 0.3), "second": (0.3, 1.0), "third": (0.8, 0.8)}
"""Amplitudes of neighbouring motors, relative to each other, of three gaits."""

KNEE = "front_left_knee"
WEAK = f"motor:{KNEE}=0.5"


def unlike(robot: Robot, knee: float = 1.0) -> Robot:
    """A robot with other masses and damping, and a factor of the torque of the front left knee."""
    gains = np.ones(robot.model.nu)
    gains[robot.anatomy.motors.index(KNEE)] = knee
    own = dataclasses.replace(
        nominal(robot), root_mass=1.2, limb_mass=0.8, damping=2.5, motor_gains=tuple(gains)
    )
    return with_model(robot, model_with_parameters(robot, own), robot.control_delay)


@cache
def moved(robot: Robot, gait: str, *, pace: int = 1, truth: str = "intact") -> Trial:
    """A trial of a robot under sinusoids of a gait, ``pace`` times as fast."""
    sizes = np.resize(GAITS[gait], robot.model.nu)
    commands = sizes * random_motion(robot, pace * STEPS, seed=2)[::pace]
    driver = played_back(robot.anatomy.motors, commands)
    run = trial_of(robot, truth, driver, steps=STEPS, name="imported")
    return dataclasses.replace(run, path=f"{truth}-{gait}-{pace}.mcap")


@cache
def table_of(robot: Robot) -> LossTable:
    """Losses of a self-model, which are kept from test to test."""
    return LossTable(Simulator(robot, 1), SEGMENT_PREDICTION)


def problem_of(
    table: LossTable,
    trial: Trial | list[Trial],
    healthy: Sequence[Trial],
    refit: Robot | None = None,
) -> Problem:
    """The problem of a trial; a refit of the self-model to all trials gives ``refit``."""
    robot = load_robot("quadruped")
    trials = trial if isinstance(trial, list) else [trial]

    def refitted(_: Sequence[Trial], hypotheses: Sequence[Hypothesis]) -> Robot:
        assert [*hypotheses[: len(healthy)]] == [INTACT] * len(healthy)
        return refit or robot

    return synthetic.problem_of(table, robot, trials, healthy, DEFAULT_KINDS, refit=refitted)


def doubted(problem: Problem, accused: str, ratio: float = 2.0) -> Doubt | None:
    """The doubt about an accusation by a loss of ``ratio`` times that of the healthy trials."""
    hypothesis = parse(accused, problem.space.anatomy)
    worst = max(problem.table.losses([INTACT], [one]).mean() for one in problem.healthy_trials)
    loss = ratio * float(worst)
    healthy = float(problem.healthy([INTACT]).mean())
    return doubt_of(hypothesis, Fit(loss, loss, healthy, None, 6.0, bool(hypothesis)), problem)
