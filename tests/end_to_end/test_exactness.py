"""The contract of exactness: without a gap, the truth predicts a trial from any logged state.

A robot with a free joint is predicted to the bit. The log of a planar robot contains its base as a
position and a quaternion, so the joint positions of the base are those of the trial within
rounding.
"""

import dataclasses
import itertools
from functools import cache

import pytest

from selfmodel import arguments
from selfmodel.controllers.playback import played_back
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import calibrate
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import TrialPlan
from tests.helpers.drivers import random_motion
from tests.helpers.exactness import exactness, prediction_error, with_options
from tests.helpers.memory import in_memory
from tests.helpers.robots.arms import arm_mjcf, robot_of
from tests.helpers.robots.go1 import go1, trot
from tests.robot.mjcf.awkward import mjcf
from tests.robot.mjcf.samples import SAMPLES

STEPS = 40
ROUNDING = 1e-9
"""Largest error of the prediction of a planar robot, in the units of the signals."""

BODIES = {
    "go1": go1(),
    "go1 with filters": go1().replace('kp="35"', 'kp="35" timeconst="0.03"'),
    "arm": arm_mjcf(),
    "two legs": mjcf(),
    **{
        name: SAMPLES[f"gymnasium {name}"].read_text(encoding="utf-8")
        for name in ("ant", "walker2d", "half_cheetah", "humanoid")
    },
}
PLANAR = (
    *("walker2d", "half_cheetah"),
    *("suite-walker", "suite-cheetah", "suite-hopper", "suite-swimmer"),
)
SUITE = (
    *("quadruped-walk", "walker-walk", "cheetah-run", "hopper-hop", "humanoid-walk"),
    *("humanoid_CMU-walk", "dog-walk", "swimmer-swimmer6", "fish-swim"),
)
OPTIONS = tuple(
    itertools.product(
        ("PGS", "CG", "Newton"),
        ("pyramidal", "elliptic"),
        ("Euler", "implicitfast", "implicit", "RK4"),
    )
)
"""Every solver with every cone and integrator."""


@cache
def loaded(name: str, iterations: int) -> Robot:
    """The robot of a file whose solver has so many iterations."""
    return robot_of(with_options(BODIES[name], iterations=str(iterations)))


def configured(name: str, iterations: int, options: tuple[str, str, str]) -> Robot:
    robot = loaded(name, iterations)
    named = dict(zip(("solver", "cone", "integrator"), options, strict=True))
    return dataclasses.replace(robot, mjcf=with_options(robot.mjcf, **named))


def check(name: str, robot: Robot, hypothesis: Hypothesis = INTACT) -> None:
    driver = played_back(robot.anatomy.motors, random_motion(robot, STEPS))
    prediction, displacement = exactness(robot, hypothesis, driver, STEPS)

    assert prediction <= (ROUNDING if name.startswith(PLANAR) else 0.0), name
    assert displacement == 0.0, name


@pytest.mark.parametrize("iterations", [1, 4, 100])
def test_prediction_is_exact_with_every_solver_and_integrator(iterations: int):
    for options in OPTIONS[::5]:  # each solver, cone and integrator
        check("go1", configured("go1", iterations, options))


@pytest.mark.search
@pytest.mark.parametrize("name", BODIES)
def test_prediction_is_exact_for_every_body_with_every_combination_of_options(name: str):
    for number, options in enumerate(OPTIONS):
        check(name, configured(name, (1, 4)[number % 2], options))


def test_calibration_leaves_an_exact_go1_as_it_is_to_the_bit():
    robot = loaded("go1", 1)  # as MJX's models have
    driver = trot(robot, STEPS)
    plan = TrialPlan("before", "before", driver, STEPS, 0)
    found = calibrate(robot, [in_memory(robot)(SimulatedRobot(robot), plan)], threads=1)

    assert found.error_before == found.error == 0.0
    assert found.robot is robot


@pytest.mark.parametrize("truth", ["break:FR_calf_joint", "motor:RL_hip_joint=0.5", "wind=20.0"])
def test_prediction_is_exact_under_a_fault(truth: str):
    robot = loaded("go1", 1)

    check(truth, robot, parse(truth, robot.anatomy))


@pytest.mark.bodies
@pytest.mark.parametrize("name", SUITE)
def test_prediction_is_exact_for_a_body_of_the_suite_in_its_own_environment(name: str):
    entry = arguments.robot_entry(f"suite-{name}")
    robot = entry.robot()
    check(f"suite-{name}", robot)

    driver = played_back(robot.anatomy.motors, random_motion(robot, STEPS))
    assert entry.physical is not None
    log = collect(robot.anatomy.names, entry.physical(robot, INTACT).run(driver, STEPS))
    error = prediction_error(Simulator(robot, 1), INTACT, log)
    assert error <= (ROUNDING if f"suite-{name}".startswith(PLANAR) else 0.0)
