"""The contract of exactness: without a gap, the truth predicts a trial from any logged state.

A robot with a free joint is predicted to the bit. The log of a planar robot contains its base as a
position and a quaternion, so the joint positions of the base are those of the trial within
rounding.
"""

import itertools
from pathlib import Path

import pytest

from selfmodel import arguments
from selfmodel.controllers.playback import played_back
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import calibrate
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import collect
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_motion
from tests.helpers.exactness import Exactness, exactness, prediction_error, with_options
from tests.helpers.robots.arms import arm_mjcf
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
    "walker2d",
    "half_cheetah",
    "suite-walker",
    "suite-cheetah",
    "suite-hopper",
    "suite-swimmer",
)

SOLVERS = ("PGS", "CG", "Newton")
ITERATIONS = ("1", "4", "100")
CONES = ("pyramidal", "elliptic")
INTEGRATORS = ("Euler", "implicitfast", "implicit", "RK4")

PAIRS = [
    (SOLVERS[s], ITERATIONS[(s + g) % 3], CONES[(s + g) % 2], INTEGRATORS[g])
    for s in range(3)
    for g in range(4)
]
"""Every pair of two options' values, in 12 combinations of the 72."""

ALL = list(itertools.product(SOLVERS, ITERATIONS, CONES, INTEGRATORS))

Options = tuple[str, str, str, str]


def loaded(name: str, options: Options, folder: Path) -> Robot:
    names = ("solver", "iterations", "cone", "integrator")
    path = folder / f"{name.replace(' ', '_')}.xml"
    options_by_name = dict(zip(names, options, strict=True))
    path.write_text(with_options(BODIES[name], **options_by_name), encoding="utf-8")
    return load_mjcf(path)


def measured(robot: Robot, hypothesis: Hypothesis = INTACT) -> Exactness:
    driver = played_back(robot.anatomy.motors, random_motion(robot, STEPS))
    return exactness(robot, hypothesis, driver, STEPS)


def check(name: str, found: Exactness) -> None:
    bound = ROUNDING if name.startswith(PLANAR) else 0.0
    assert found.prediction <= bound, (name, found)
    assert found.displacement == 0.0, (name, found)


def test_the_combinations_have_every_pair_of_options():
    for one, other in itertools.combinations(range(4), 2):
        pairs = {(row[one], row[other]) for row in PAIRS}
        assert pairs == {(row[one], row[other]) for row in ALL}


@pytest.mark.parametrize("options", PAIRS, ids="-".join)
def test_prediction_is_exact_with_every_solver_and_integrator(options: Options, tmp_path: Path):
    for name in ("go1", list(BODIES)[1 + PAIRS.index(options) % (len(BODIES) - 1)]):
        check(name, measured(loaded(name, options, tmp_path)))


@pytest.mark.search
@pytest.mark.parametrize("name", BODIES)
def test_prediction_is_exact_with_every_combination_of_options(name: str, tmp_path: Path):
    for options in ALL:
        check(name, measured(loaded(name, options, tmp_path)))


def test_calibration_leaves_an_exact_go1_as_it_is_to_the_bit(tmp_path: Path):
    path = tmp_path / "go1.xml"
    path.write_text(go1(), encoding="utf-8")  # one iteration, as MJX's models have
    robot = load_mjcf(path)
    driver = trot(robot, STEPS)
    log = collect(robot.anatomy.names, SimulatedRobot(robot).run(driver, STEPS))
    plan = TrialPlan("before", "before", driver, STEPS, 0)
    found = calibrate(robot, [Trial(plan, robot.name, log, "before.mcap")], threads=1)

    assert found.error_before == found.error == 0.0
    assert found.robot is robot


@pytest.mark.parametrize("truth", ["break:FR_calf_joint", "motor:RL_hip_joint=0.5", "wind=20.0"])
def test_prediction_is_exact_under_a_fault(truth: str, tmp_path: Path):
    robot = loaded("go1", PAIRS[0], tmp_path)

    check(truth, measured(robot, parse(truth, robot.anatomy)))


@pytest.mark.bodies
@pytest.mark.parametrize(
    "name",
    [
        "suite-quadruped-walk",
        "suite-walker-walk",
        "suite-cheetah-run",
        "suite-hopper-hop",
        "suite-humanoid-walk",
        "suite-humanoid_CMU-walk",
        "suite-dog-walk",
        "suite-swimmer-swimmer6",
        "suite-fish-swim",
    ],
)
def test_prediction_is_exact_for_a_body_of_the_suite_in_its_own_environment(name: str):
    entry = arguments.robot_entry(name)
    robot = entry.robot()
    check(name, measured(robot))

    driver = played_back(robot.anatomy.motors, random_motion(robot, STEPS))
    assert entry.physical is not None
    log = collect(robot.anatomy.names, entry.physical(robot, INTACT).run(driver, STEPS))
    error = prediction_error(Simulator(robot, 1), INTACT, log)
    assert error <= (ROUNDING if name.startswith(PLANAR) else 0.0)
