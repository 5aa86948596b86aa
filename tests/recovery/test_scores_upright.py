"""Promises of the score ``upright``, and of its limits on the joints."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.arguments import robot_entry
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.recovery.falls import FALLEN_TIME, fall_of, falls_of
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT, upright_within
from selfmodel.robot.robot import Robot
from selfmodel.robot.self_collision import penetration_depths
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.robots.arms import arm

STEPS = 5


def walked(robot: Robot, x: list[float], tilts: list[float], heights: list[float]) -> Behaviour:
    """A run of the base alone, tilted about its y axis by angles in rad."""
    half = np.array(tilts) / 2
    orientation = np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=1)
    position = np.stack([x, np.zeros(len(x)), heights], axis=1)
    signals = {"base_position": position[None], "base_orientation": orientation[None]}
    return Behaviour(robot.anatomy.names, np.arange(len(x)) * FALLEN_TIME, signals)


def test_a_run_without_a_fall_has_its_displacement(quadruped: Robot):
    height = quadruped.standing_height
    run = walked(quadruped, [0, 1, 2, 3, 4], [0.0] * STEPS, [height] * STEPS)
    assert UPRIGHT.of(quadruped, INTACT, run) == DISPLACEMENT.of(quadruped, INTACT, run) == 4
    assert falls_of(quadruped, INTACT, run) == STEPS


@pytest.mark.parametrize("fall", range(1, STEPS))
def test_nothing_counts_from_a_fall_on_its_back_or_on_its_belly(quadruped: Robot, fall: int):
    height = quadruped.standing_height
    x, turned = [0.0, 1, 2, 30, 400], [0.0] * fall + [np.pi] + [0.0] * (STEPS - fall - 1)
    low = [height] * fall + [0.3 * height] + [height] * (STEPS - fall - 1)
    for run in (
        walked(quadruped, x, turned, [height] * STEPS),
        walked(quadruped, x, [0.0] * STEPS, low),
    ):
        assert UPRIGHT.of(quadruped, INTACT, run) == x[fall - 1]
        assert falls_of(quadruped, INTACT, run) == fall


def test_the_ground_of_a_slope_is_that_of_the_hypothesis(quadruped: Robot):
    slope = parse("slope=-0.5", quadruped.anatomy)
    runs = [(slope, driver) for driver in random_controllers(quadruped, 1)]
    behaviour = Simulator(quadruped, 1).run(runs, 2, UPRIGHT.record).behaviour
    assert falls_of(quadruped, slope, behaviour) == 2


def test_height_is_measured_from_the_sloping_ground(quadruped: Robot):
    slope = parse("slope=-0.5", quadruped.anatomy)
    normal = build(quadruped, slope).normal
    x = np.arange(STEPS) * np.sign(normal[0])  # downhill
    heights = (quadruped.standing_height - normal[0] * x) / normal[2]
    run = walked(quadruped, x.tolist(), [0.0] * STEPS, heights.tolist())
    assert falls_of(quadruped, slope, run) == STEPS
    assert falls_of(quadruped, INTACT, run) == 1


def test_the_score_of_a_run_does_not_depend_on_its_batch(quadruped: Robot):
    runs = [(INTACT, driver) for driver in random_controllers(quadruped, 6, seed=3)]
    behaviour = Simulator(quadruped, 1).run(runs, 150, UPRIGHT.record).behaviour
    alone = [
        UPRIGHT.of(
            quadruped,
            INTACT,
            Behaviour(
                behaviour.names,
                behaviour.time,
                {signal: values[k : k + 1] for signal, values in behaviour.signals.items()},
            ),
        )[0]
        for k in range(len(runs))
    ]
    assert UPRIGHT.of(quadruped, INTACT, behaviour).tolist() == alone


@pytest.mark.parametrize(("planned", "fall"), [(60, 39), (40, None)])
def test_the_last_pose_of_a_trial_that_ended_early_counts_as_if_it_remained(
    quadruped: Robot, planned: int, fall: int | None
):
    (driver,) = random_controllers(quadruped, 1)
    batch = walked(quadruped, [0.0] * 40, [0.0] * 39 + [np.pi], [quadruped.standing_height] * 40)
    signals = {name: values[0] for name, values in batch.signals.items()}
    behaviour = Behaviour(batch.names, np.arange(40) * 0.01, signals)
    trial = Trial(
        TrialPlan("single", "single", driver, planned, 0), quadruped.name, behaviour, "a log"
    )

    assert fall_of(quadruped, INTACT, trial) == fall


def test_a_fixed_base_does_not_fall():
    runs = [(INTACT, driver) for driver in random_cpgs(arm(), 1)]
    behaviour = Simulator(arm(), 1).run(runs, 50, UPRIGHT.record).behaviour
    assert falls_of(arm(), INTACT, behaviour) == 50


def hurried(robot: Robot, x: list[float], speeds: list[float], torques: list[float]) -> Behaviour:
    """An upright run with one fast joint and one that has torque."""
    steps, hinges = len(x), len(robot.anatomy.hinges)
    position = np.stack([x, np.zeros(steps), np.full(steps, robot.standing_height)], axis=1)
    velocity, effort = np.zeros((2, 1, steps, hinges))
    velocity[0, :, 1], effort[0, :, 2] = speeds, torques
    signals = {
        "base_position": position[np.newaxis],
        "base_orientation": np.tile([1.0, 0, 0, 0], (1, steps, 1)),
        "joint_velocities": velocity,
        "joint_efforts": effort,
    }
    return Behaviour(robot.anatomy.names, np.arange(steps) * 0.01, signals)


@pytest.mark.parametrize(
    ("speeds", "torques", "displacement"),
    [
        ([9, 0, 0, 0, 0], [0, 0, 0, 0, 0], 11),  # before the first displacement
        ([0, 5, 0, 0, 0], [0, 0, 0, 0, 0], 11),  # at the limit
        ([0, 6, 0, 0, 0], [0, 0, 0, 0, 0], 10),
        ([0, -6, 0, 0, 0], [0, 0, 0, 0, -3], 2),
        ([0, 0, 6, 0, 0], [0, 0, 0, 0, 0], 11),  # backwards
        ([np.nan, np.nan, 0, 0, 0], [0, 0, 0, 0, np.nan], 11),
    ],
)
def test_a_step_in_which_a_joint_is_over_a_limit_earns_nothing(
    quadruped: Robot, speeds: list[float], torques: list[float], displacement: float
):
    run = hurried(quadruped, [0, 1, 0, 3, 11], speeds, torques)
    assert upright_within(5, 2).of(quadruped, INTACT, run).tolist() == [displacement]


@given(speed=st.floats(0.5, 20), torque=st.floats(0.1, 20))
def test_limits_cost_displacement_and_without_limits_it_is_the_score_upright(
    quadruped: Robot, speed: float, torque: float
):
    score = upright_within(speed, torque)
    runs = [(INTACT, driver) for driver in random_controllers(quadruped, 3, seed=2)]
    run = Simulator(quadruped, 1).run(runs, 60, score.record).behaviour
    upright = UPRIGHT.of(quadruped, INTACT, run)

    assert (score.of(quadruped, INTACT, run) <= upright + 1e-9).all()
    np.testing.assert_allclose(upright_within().of(quadruped, INTACT, run), upright, atol=1e-12)


@pytest.fixture(scope="module")
def hexapod() -> Robot:
    return robot_entry("hexapod").robot()


@pytest.fixture(scope="module")
def crossed(hexapod: Robot) -> np.ndarray:
    """Joint positions at which two legs of the hexapod cross, rad."""
    limits = np.concatenate([joint.limits for joint in hexapod.anatomy.joints])
    poses = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (200, len(limits)))
    return poses[np.argmax(penetration_depths(hexapod, poses))]


def crossing(robot: Robot, x: list[float], crossed: np.ndarray, steps: list[int]) -> Behaviour:
    """An upright run in which two legs cross in some steps."""
    run = hurried(robot, x, [0.0] * len(x), [0.0] * len(x))
    positions = np.zeros((1, len(x), len(crossed)))
    positions[0, steps] = crossed
    return Behaviour(run.names, run.time, {**run.signals, "joint_positions": positions})


X = [0.0, 1, 3, 2, 6, 7, 8, 9]


@pytest.mark.parametrize(
    ("steps", "displacement"),
    [
        ([], 9),
        ([2, 3], 9),  # 2 of the 5 steps of 0.05 s
        ([2, 3, 4], 1),
        ([1, 3, 5], 0),
        ([4, 5, 6, 7], 2),
        ([6, 7], 9),  # 2 of the last 5 steps
        ([0, 1, 2], 0),
    ],
)
def test_nothing_counts_from_a_self_collision_on_that_lasts(
    hexapod: Robot, crossed: np.ndarray, steps: list[int], displacement: float
):
    run = crossing(hexapod, X, crossed, steps)
    depth = float(penetration_depths(hexapod, crossed[np.newaxis])[0])

    for limit in (0.0, 0.99 * depth):
        assert upright_within(max_self_collision=limit).of(hexapod, INTACT, run) == displacement
    assert upright_within(max_self_collision=1.01 * depth).of(hexapod, INTACT, run) == 9
    both = upright_within(max_speed=5, max_self_collision=0.0).of(hexapod, INTACT, run)
    assert both == displacement


def test_a_joint_that_is_missed_is_where_it_was(hexapod: Robot, crossed: np.ndarray):
    score = upright_within(max_self_collision=0.0)
    run = crossing(hexapod, X, crossed, [2])
    run.signals["joint_positions"][0, 3:] = np.nan
    assert score.of(hexapod, INTACT, run) == 1
    run.signals["joint_positions"][:] = np.nan
    assert score.of(hexapod, INTACT, run) == 9  # the initial pose


def test_what_came_off_collides_with_nothing_and_an_encoder_is_corrected(
    hexapod: Robot, crossed: np.ndarray
):
    score = upright_within(max_self_collision=0.0)
    run = crossing(hexapod, X, crossed, [*range(1, len(X))])
    assert score.of(hexapod, INTACT, run) == 0
    lost = [parse(f"break:{joint.name}", hexapod.anatomy) for joint in hexapod.anatomy.joints]
    assert max(score.of(hexapod, one, run).item() for one in lost) == 9

    true = run["joint_positions"]
    depth = float(penetration_depths(hexapod, true[0]).max())
    for joint in hexapod.anatomy.joints:
        wrong = parse(f"encoder-offset:{joint.name}=0.5", hexapod.anatomy)
        logged = true + build(hexapod, wrong).encoder_offset
        shifted = Behaviour(run.names, run.time, {**run.signals, "joint_positions": logged})
        assert upright_within(max_self_collision=depth + 1e-9).of(hexapod, wrong, shifted) == 9
        assert upright_within(max_self_collision=depth - 1e-9).of(hexapod, wrong, shifted) == 0


def test_only_a_limit_of_self_collision_needs_the_joint_positions():
    assert "joint_positions" not in upright_within(5, 2).record
    assert "joint_positions" in upright_within(max_self_collision=0.01).record


@pytest.mark.parametrize("limits", [(0, 1), (1, -1), (float("nan"), 1), (1, 1, -0.01)])
def test_a_limit_is_above_0(limits: tuple[float, ...]):
    with pytest.raises(ValueError, match="expected limits above 0"):
        upright_within(*limits)


def test_a_slope_tilts_the_ground_of_the_fall(quadruped: Robot):
    slope = parse("slope=-0.5", quadruped.anatomy)
    score = upright_within(5, 2)
    run = hurried(quadruped, [0, -1, -2, -3, -4], [0.0] * 5, [0.0] * 5)
    for hypothesis in (slope, INTACT):
        expected = UPRIGHT.of(quadruped, hypothesis, run)
        assert score.of(quadruped, hypothesis, run) == expected


def test_a_base_that_is_missed_for_some_steps_has_moved(quadruped: Robot):
    run = hurried(quadruped, [0, 1, np.nan, np.nan, 11], [0.0] * 5, [0.0] * 5)
    for score in (upright_within(5, 2), upright_within(), UPRIGHT):
        assert score.of(quadruped, INTACT, run) == 11


def test_a_joint_that_came_off_has_no_limit(quadruped: Robot):
    lost = parse("break:front_left_knee", quadruped.anatomy)
    name = quadruped.anatomy.hinges[1]
    assert name == "front_left_knee"
    run = hurried(quadruped, [0, 1, 2, 3, 4], [9.0] * 5, [0.0] * 5)
    score = upright_within(5, 2)
    assert (score.of(quadruped, lost, run), score.of(quadruped, INTACT, run)) == (4, 0)


def test_its_name_has_its_limits():
    names = [upright_within(5, 2).name, upright_within(max_torque=2.5).name, upright_within().name]
    assert upright_within(max_self_collision=0.005).name == (
        "upright within 0.005 m of self-collision"
    )
    assert names == ["upright within 5 rad/s and 2 N m", "upright within 2.5 N m", "upright"]
