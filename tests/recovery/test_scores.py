"""Promises of the scores: the falls that end them, the limits, and the checks of a plug-in's."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.arguments import robot_entry
from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.recovery.falls import FALLEN_HEIGHT, FALLEN_TIME, fall_of, falls_of, first_falls
from selfmodel.recovery.scores import (
    DISPLACEMENT,
    ENERGY,
    LARGEST,
    SCORES,
    STRAIGHT,
    UPRIGHT,
    WORK_WEIGHT,
    Score,
    checked,
    joint_work,
    upright_within,
)
from selfmodel.robot.contacts import penetration_depths
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import Names
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.robots.arms import arm

NAMES = Names(sensors=("touch",), motors=("motor",), hinges=("hinge",))
UP, HEIGHT = np.array([0.0, 0.0, 1.0]), 0.3
LOW, UPSIDE_DOWN = 0.4 * HEIGHT, [0.0, 1.0, 0, 0]


def observed(steps: int = 100, **changes: tuple[slice, object]) -> Trajectory:
    """Steps of 0.01 s on level ground, of which some poses are replaced."""
    signals = {
        "base_position": np.full((steps, 3), HEIGHT),
        "base_orientation": np.tile([1.0, 0, 0, 0], (steps, 1)),
    }
    for name, (which, value) in changes.items():
        signals[f"base_{name}"][which] = value
    return Trajectory(NAMES, np.arange(steps) / 100, signals)


@given(
    start=st.integers(0, 2**31),
    lean=st.floats(0, np.pi),
    way=st.floats(-10, 10),
    height=st.floats(0, 2),
    slope=st.floats(-0.3, 0.3),
)
def test_a_base_has_fallen_when_it_leans_from_its_start_or_is_near_the_ground_of_a_slope(
    start: int, lean: float, way: float, height: float, slope: float
):
    along = np.array([np.cos(slope), 0, np.sin(slope)])
    normal = np.array([-np.sin(slope), 0, np.cos(slope)])
    lying = Rotation.random(random_state=start)
    about = Rotation.from_rotvec(lean * np.array([0.6, 0.8, 0]))
    turns = Rotation.concatenate([lying, about * lying]).as_quat(scalar_first=True)
    position = np.array([HEIGHT * normal, way * along + height * normal])
    signals = {"base_position": position, "base_orientation": turns}
    falls = first_falls(Trajectory(NAMES, np.array([0, FALLEN_TIME]), signals), normal, HEIGHT)

    margins = [lean - np.pi / 3, FALLEN_HEIGHT * HEIGHT - height]
    if np.abs(margins).min() > 1e-6:
        assert falls == (1 if max(margins) > 0 else 2)


@pytest.mark.parametrize("height", [0.0, -0.1])
def test_a_base_that_begins_on_the_ground_has_no_height_to_fall_from(height: float):
    run = observed(position=(slice(None), height))
    assert first_falls(run, UP, height) == 100


@pytest.mark.parametrize(
    ("steps", "low", "fall"),
    [
        (100, [(10, 22)], 100),  # 0.12 s
        (100, [(10, 23)], 10),  # 0.13 s of 0.25 s
        (100, [(10, 20), (23, 28)], 10),
        (100, [(10, 14), (50, 90)], 50),
        (100, [(87, 100)], 87),  # the run ends in it: 0.13 s of its last 0.25 s
        (100, [(88, 100)], 100),
        (100, [(80, 86), (93, 100)], 80),
        (8, [(4, 8)], 8),  # a run shorter than a quarter of a second is judged as a whole
        (8, [(3, 8)], 3),
    ],
)
def test_a_base_has_fallen_that_is_low_in_most_of_a_quarter_of_a_second(
    steps: int, low: list[tuple[int, int]], fall: int
):
    position = np.full((2, steps, 3), HEIGHT)
    for first, end in low:
        position[1, first:end, 2] = LOW
    orientation = np.broadcast_to([1.0, 0, 0, 0], (2, steps, 4))
    signals = {"base_position": position, "base_orientation": orientation}
    for begin in (0.0, 1.7e9):
        time = begin + np.arange(steps) / 100
        assert first_falls(Trajectory(NAMES, time, signals), UP, HEIGHT).tolist() == [steps, fall]


REFERENCE = np.tile(UPSIDE_DOWN, (100, 1))
REFERENCE[0], REFERENCE[50:] = np.nan, [1.0, 0, 0, 0]


@pytest.mark.parametrize(
    ("pose", "fall"),
    [
        ({"position": (slice(30, None), LOW), "orientation": (slice(None), np.nan)}, 30),
        ({"orientation": (slice(30, None), UPSIDE_DOWN), "position": (slice(None), np.nan)}, 30),
        ({"position": (slice(None), np.nan), "orientation": (slice(None), np.nan)}, 100),
        ({"position": (slice(20, 60), np.nan), "orientation": (slice(20, 60), np.nan)}, 100),
        ({"orientation": (slice(None), REFERENCE)}, 50),  # from the first one that is known
    ],
)
def test_what_is_observed_of_a_base_is_enough_for_a_fall(
    pose: dict[str, tuple[slice, object]], fall: int
):
    assert first_falls(observed(**pose), UP, HEIGHT) == fall


def test_a_base_that_is_missed_while_it_is_low_has_fallen():
    position = np.full((100, 3), HEIGHT)
    position[10:20] = LOW
    position[15:60] = np.nan
    orientation = np.where(np.isnan(position[:, :1]), np.nan, [1.0, 0, 0, 0])
    run = observed(position=(slice(None), position), orientation=(slice(None), orientation))
    assert first_falls(run, UP, HEIGHT) == 10


STEPS = 5


def walked(robot: Robot, x: list[float], tilts: list[float], heights: list[float]) -> Trajectory:
    """A run of the base alone, tilted about its y axis by angles in rad."""
    half = np.array(tilts) / 2
    orientation = np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=1)
    position = np.stack([x, np.zeros(len(x)), heights], axis=1)
    signals = {"base_position": position[None], "base_orientation": orientation[None]}
    return Trajectory(robot.anatomy.names, np.arange(len(x)) * FALLEN_TIME, signals)


@pytest.mark.parametrize("fall", range(1, STEPS + 1))
def test_nothing_counts_from_a_fall_on_its_back_or_on_its_belly(quadruped: Robot, fall: int):
    height = quadruped.standing_height
    x = [0.0, 1, 2, 30, 400]
    turned, low = ([up] * fall + [down] + [up] * STEPS for up, down in ((0.0, np.pi), (1, 0.3)))
    for run in (
        walked(quadruped, x, turned[:STEPS], [height] * STEPS),
        walked(quadruped, x, [0.0] * STEPS, [height * part for part in low[:STEPS]]),
    ):
        assert UPRIGHT.of(quadruped, INTACT, run) == x[fall - 1]
        assert falls_of(quadruped, INTACT, run) == fall
        assert DISPLACEMENT.of(quadruped, INTACT, run) == 400


def test_height_is_measured_from_the_ground_of_the_hypothesis(quadruped: Robot):
    slope = parse("slope=-0.5", quadruped.anatomy)
    normal = build(quadruped, slope).normal
    x = np.arange(STEPS) * np.sign(normal[0])  # downhill
    heights = (quadruped.standing_height - normal[0] * x) / normal[2]
    run = walked(quadruped, x.tolist(), [0.0] * STEPS, heights.tolist())
    assert falls_of(quadruped, slope, run) == STEPS
    assert falls_of(quadruped, INTACT, run) == 1
    still = hurried(quadruped, run["base_position"][0, :, 0], [0.0] * 5, [0.0] * 5)
    for hypothesis in (slope, INTACT):
        expected = UPRIGHT.of(quadruped, hypothesis, still)
        assert upright_within(5, 2).of(quadruped, hypothesis, still) == expected


@pytest.mark.parametrize("fall", [20, 12])
@pytest.mark.parametrize("way", [2.0, -2.0])
@pytest.mark.parametrize("degrees", [-90, 0, 45, 180, 350])
def test_a_run_is_worth_less_the_more_the_robot_has_turned_at_its_last_step_upright(
    quadruped: Robot, degrees: int, way: float, fall: int
):
    steps = np.arange(20)
    tilts = np.where(steps < fall, 0.0, np.pi).tolist()
    x, heights = way * steps / (fall - 1), [quadruped.standing_height] * 20
    run = walked(quadruped, x.tolist(), tilts, heights)
    upward = Rotation.from_quat(run["base_orientation"][0], scalar_first=True)
    headings = np.radians(degrees) * steps[:, np.newaxis] / (fall - 1)
    turned = Rotation.from_euler("z", headings) * upward
    run["base_orientation"][0] = turned.as_quat(scalar_first=True)
    run["base_orientation"][0, 3] = np.nan  # a reading that was lost

    (distance,), (score,) = (one.of(quadruped, INTACT, run) for one in (UPRIGHT, STRAIGHT))
    assert distance == pytest.approx(way)
    assert score == pytest.approx(way - abs(way) * min(1, abs(degrees) / 180))


@pytest.mark.parametrize("name", SCORES)
def test_the_score_of_a_run_does_not_depend_on_its_batch(quadruped: Robot, name: str):
    score = SCORES[name]
    runs = [(INTACT, driver) for driver in random_controllers(quadruped, 6, seed=3)]
    simulator = Simulator(quadruped, 1)
    together, *alone = (
        score.of(quadruped, INTACT, simulator.run(some, 150, score.record).trajectory)
        for some in (runs, *([run] for run in runs))
    )
    assert together.tolist() == np.concatenate(alone).tolist()


@pytest.mark.parametrize(("planned", "fall"), [(60, 39), (40, None)])
def test_the_last_pose_of_a_trial_that_ended_early_counts_as_if_it_remained(
    quadruped: Robot, planned: int, fall: int | None
):
    (driver,) = random_controllers(quadruped, 1)
    batch = walked(quadruped, [0.0] * 40, [0.0] * 39 + [np.pi], [quadruped.standing_height] * 40)
    signals = {name: values[0] for name, values in batch.signals.items()}
    trajectory = Trajectory(batch.names, np.arange(40) * 0.01, signals)
    trial = Trial(
        TrialPlan("single", "single", driver, planned, 0), quadruped.name, trajectory, "a log"
    )

    assert fall_of(quadruped, INTACT, trial) == fall


def test_a_fixed_base_does_not_fall():
    runs = [(INTACT, driver) for driver in random_cpgs(arm(), 1)]
    trajectory = Simulator(arm(), 1).run(runs, 50, UPRIGHT.record).trajectory
    assert falls_of(arm(), INTACT, trajectory) == 50


def test_a_robot_without_gravity_turns_over_and_does_not_fall(quadruped: Robot):
    floating = quadruped.mjcf.replace("<option", '<option gravity="0 0 0"', 1)
    height = quadruped.standing_height
    run = walked(quadruped, [0.0] * STEPS, [0.0] + [np.pi] * (STEPS - 1), [height] * STEPS)

    assert falls_of(quadruped, INTACT, run) == 1
    assert falls_of(dataclasses.replace(quadruped, mjcf=floating), INTACT, run) == STEPS


def hurried(robot: Robot, x: list[float], speeds: list[float], torques: list[float]) -> Trajectory:
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
    return Trajectory(robot.anatomy.names, np.arange(steps) * 0.01, signals)


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


def test_limits_cost_displacement_and_without_limits_it_is_the_score_upright(quadruped: Robot):
    runs = [(INTACT, driver) for driver in random_controllers(quadruped, 3, seed=2)]
    run = Simulator(quadruped, 1).run(runs, 60, upright_within(1, 1).record).trajectory
    upright = UPRIGHT.of(quadruped, INTACT, run)

    for limits in ((0.5, 20), (20, 0.1), (5, 2)):
        assert (upright_within(*limits).of(quadruped, INTACT, run) <= upright + 1e-9).all()
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


def crossing(robot: Robot, x: list[float], crossed: np.ndarray, steps: list[int]) -> Trajectory:
    """An upright run in which two legs cross in some steps."""
    run = hurried(robot, x, [0.0] * len(x), [0.0] * len(x))
    positions = np.zeros((1, len(x), len(crossed)))
    positions[0, steps] = crossed
    return Trajectory(run.names, run.time, {**run.signals, "joint_positions": positions})


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
    for joint in hexapod.anatomy.joints[::4]:
        wrong = parse(f"encoder-offset:{joint.name}=0.5", hexapod.anatomy)
        logged = true + build(hexapod, wrong).encoder_offset
        shifted = Trajectory(run.names, run.time, {**run.signals, "joint_positions": logged})
        assert upright_within(max_self_collision=depth + 1e-9).of(hexapod, wrong, shifted) == 9
        assert upright_within(max_self_collision=depth - 1e-9).of(hexapod, wrong, shifted) == 0


@pytest.mark.parametrize("limits", [(0, 1), (1, -1), (float("nan"), 1), (1, 1, -0.01)])
def test_a_limit_is_above_0(limits: tuple[float, ...]):
    with pytest.raises(ValueError, match="expected limits above 0"):
        upright_within(*limits)


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


def test_its_name_has_its_limits_and_only_a_self_collision_needs_the_joint_positions():
    scores = upright_within(5, 2), upright_within(max_self_collision=0.005), upright_within()
    assert [score.name for score in scores] == [
        *("upright within 5 rad/s and 2 N m", "upright within 0.005 m of self-collision"),
        "upright",
    ]
    assert ["joint_positions" in score.record for score in scores] == [False, True, False]


def test_work_is_power_over_time_in_either_direction(quadruped: Robot):
    hinges = len(quadruped.anatomy.hinges)
    effort, velocity = np.zeros((1, 3, hinges)), np.ones((1, 3, hinges))
    effort[0, 0, 0], effort[0, 1, 1], effort[0, 2, 2] = 2.0, -3.0, np.nan
    names, time = quadruped.anatomy.names, np.arange(3) * quadruped.control_timestep
    run = Trajectory(names, time, {"joint_efforts": effort, "joint_velocities": velocity})
    np.testing.assert_allclose(joint_work(quadruped, run), [5 * quadruped.control_timestep])
    unknown = {"joint_efforts": np.full_like(effort, np.nan), "joint_velocities": velocity}
    assert np.isnan(joint_work(quadruped, Trajectory(names, time, unknown))).all()


def test_the_score_is_the_upright_displacement_less_the_work_over_the_weight(quadruped: Robot):
    drivers = random_controllers(quadruped, 4)
    lost = parse("break:front_left_shoulder", quadruped.anatomy)
    for hypothesis in (INTACT, lost):
        runs = [(hypothesis, driver) for driver in drivers]
        run = Simulator(quadruped, 1).run(runs, 100, ENERGY.record).trajectory
        spent = UPRIGHT.of(quadruped, hypothesis, run) - ENERGY.of(quadruped, hypothesis, run)
        weight = joint_work(quadruped, run) * WORK_WEIGHT / spent
        gravity = np.linalg.norm(quadruped.model.opt.gravity)
        masses = weight / gravity
        np.testing.assert_allclose(masses, masses[0])
        whole = quadruped.model.body_mass.sum()
        assert masses[0] < whole if hypothesis == lost else np.isclose(masses[0], whole)


RUNS = 3


def ran(robot: Robot, x: float = 1.0) -> Trajectory:
    """Three runs, of which the last ends at ``x``."""
    position = np.ones((RUNS, 4, 3))
    position[-1, -1, 0] = x
    return Trajectory(robot.anatomy.names, np.arange(4) * 0.01, {"base_position": position})


def scored(robot: Robot, of: Callable[[Trajectory], object], x: float = 1.0) -> FloatArray:
    """What a score of a plug-in returns once it is checked."""

    def mine(_robot: Robot, _hypothesis: Hypothesis, trajectory: Trajectory) -> FloatArray:
        return of(trajectory)  # type: ignore[return-value]

    score = checked(Score("mine", ("base_position",), mine), "my.module:SCORE")
    return score.of(robot, INTACT, ran(robot, x))


@pytest.mark.parametrize("record", [("base_pos",), ("base_position", "speed"), (), []])
def test_signals_that_are_unknown_are_refused_when_the_score_is_loaded(record: object):
    score = Score("mine", record, DISPLACEMENT.of)  # type: ignore[arg-type]

    with pytest.raises(InputError, match=r"my.module:SCORE.*record=.*expected.*base_position.*cor"):
        checked(score, "my.module:SCORE")


@pytest.mark.parametrize(
    ("of", "message"),
    [
        (
            lambda run: run["base_position"][..., 0],
            r"expected one number for each of 3 runs.*\(3, 4",
        ),
        (lambda run: run["base_position"].sum(), r"shape \(3,\), got shape \(\)"),
        (lambda _run: None, r"got shape \(\)"),
        (lambda _run: ["fast"] * RUNS, "got list .*return an array of numbers"),
        (lambda _run: [np.nan, 0, np.nan], "got nan for 2 of them"),
        (lambda _run: [np.inf, 0, 1], "got inf for 1 of them"),
        (
            lambda run: run["joint_efforts"],
            "recorded signal 'joint_efforts'.*add the signal",
        ),
    ],
)
def test_values_that_are_no_scores_are_refused_with_the_remedy(
    quadruped: Robot, of: Callable[[Trajectory], object], message: str
):
    with pytest.raises(InputError, match=f"the score 'my.module:SCORE'.*{message}"):
        scored(quadruped, of)


@pytest.mark.parametrize("x", [np.nan, np.inf, -2 * LARGEST])
def test_a_run_that_was_not_observed_or_diverged_may_have_no_score(quadruped: Robot, x: float):
    values = scored(quadruped, lambda _run: [1, 2, np.nan], x)
    np.testing.assert_array_equal(values, [1, 2, np.nan])
    with pytest.raises(InputError, match="got nan for 1 of them"):
        scored(quadruped, lambda _run: [np.nan, 2, np.nan], x)


def test_a_right_score_is_as_before_and_an_error_of_the_plug_in_itself_remains(quadruped: Robot):
    right = checked(DISPLACEMENT, "mine")
    assert right.of(quadruped, INTACT, ran(quadruped, 5.0)).tolist() == [0, 0, 4]
    assert (right.name, right.record, right.unit) == ("displacement", ("base_position",), "m")
    assert scored(quadruped, lambda _run: [-np.inf, 1, 2]).tolist() == [-np.inf, 1, 2]
    with pytest.raises(KeyError, match="weights"):
        scored(quadruped, lambda _run: {}["weights"])
