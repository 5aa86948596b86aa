"""Promises to bodies that are not ours: of the dm_control suite, and an ant.

Whatever is promised of our own robots holds for a body that slides instead of floating, whose
motors pull tendons or lag behind their commands, and whose hinges bend to one side only.
"""

import dataclasses
import importlib
from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel.comparators.segment_prediction import SEGMENT_PREDICTION
from selfmodel.diagnosis.losses import LossTable
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.robots import robot_of
from selfmodel.logs.viewers import Kinematics, body_names
from selfmodel.logs.writer import write_trial
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.recovery.falls import first_falls
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from selfmodel.rotation import rotation_between
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import prediction_error
from selfmodel.simulation.model_factors import nominal, with_parameters
from selfmodel.simulation.reality_gap import RealityGap
from selfmodel.simulation.requests import Segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import walking
from selfmodel.trials.estimation import BASE, STATE
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory, collect
from selfmodel.trials.trial import TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.exactness import exactness
from tests.helpers.hostile import lacking
from tests.helpers.memory import in_memory
from tests.helpers.robots.bodies import BODIES, EVERY_BODY, swinging, swung
from tests.logs.conftest import plan_of

STEPS, HORIZON = 50, 10
UP = np.array([0.0, 0.0, 1.0])
EXACT, OF_DOG = 1e-6, 1e-4
"""How far a prediction may be from what happened, relative to 1 of each unit; and that of the dog,
whose light bones with 79 degrees of freedom part a little from a jammed joint."""


@pytest.fixture(params=EVERY_BODY)
def body(request: pytest.FixtureRequest) -> Robot:
    return BODIES[request.param]()


def damages(robot: Robot) -> list[Hypothesis]:
    """Nothing, a distal and a proximal joint broken and jammed, a weak motor, and a slope."""
    names = [joint.name for joint in robot.anatomy.joints]
    weak = next(joint.name for joint in robot.anatomy.joints if joint.motors)
    texts = [f"{kind}:{name}" for kind in ("break", "jam") for name in (names[0], names[-1])]
    return [
        INTACT,
        *(parse(text, robot.anatomy) for text in (*texts, f"motor:{weak}=0.5", "slope=0.2")),
    ]


def happened(robot: Robot, hypothesis: Hypothesis, gap: RealityGap | None = None) -> Trajectory:
    physical = SimulatedRobot(robot, hypothesis, gap)
    return collect(robot.anatomy.names, physical.run(swung(robot, STEPS), STEPS))


def test_the_physical_robot_moves_like_the_simulator_to_the_bit(body: Robot):
    hypotheses = damages(body)
    outcome = Simulator(body, 2).run(
        [(hypothesis, swung(body, STEPS)) for hypothesis in hypotheses], STEPS, SIGNALS
    )

    assert not outcome.diverged.any()
    for row, hypothesis in enumerate(hypotheses):
        run = happened(body, hypothesis)
        for signal in SIGNALS:
            np.testing.assert_array_equal(outcome.trajectory[signal][row], run[signal], signal)
    paths = outcome.trajectory["base_position"][:, -1]
    assert len(np.unique(paths, axis=0)) == len(hypotheses)


def test_it_walks_in_dm_control_s_world_like_in_the_simulator_to_the_bit(body: Robot):
    told = ("base_position", "base_orientation", "base_linear_velocity", "joint_positions")
    runs = [(INTACT, swung(body, 20))]
    truth = Simulator(body, 1).run(runs, 20, told).trajectory
    environment = walking.environment(body, time_limit=9.0)
    rows = [environment.reset()]
    rows += [environment.step(commands) for commands in swinging(body, 20)[:-1]]

    for signal in told[1:]:
        seen = [row.observation[signal] for row in rows]
        np.testing.assert_array_equal(seen, truth[signal][0], signal)
    heights = [row.observation["base_height"][0] for row in rows]
    np.testing.assert_array_equal(heights, truth["base_position"][0, :, 2])
    went = sum(row.reward for row in rows[1:]) * body.control_timestep
    assert went == pytest.approx(np.ptp(truth["base_position"][0, [0, -1], 0]) * np.sign(went))


def test_each_segment_of_a_trial_is_predicted_from_its_first_state(body: Robot):
    starts = np.arange(0, STEPS - HORIZON, 7)
    commands = swinging(body, STEPS)
    for hypothesis in damages(body):
        run = happened(body, hypothesis)
        segments = Segments(
            states={signal: run[signal][starts] for signal in STATE},
            commands=commands,
            starts=starts,
            horizon=HORIZON,
            record=STATE,
        )
        made = Simulator(body, 1).predict([hypothesis], segments).trajectory
        for signal in STATE:
            logged = np.stack([run[signal][k : k + HORIZON + 1] for k in starts])
            between = rotation_between if signal == "base_orientation" else np.subtract
            apart = between(made[signal][0], logged)
            scale = np.maximum(1, np.abs(logged).max())
            limit = OF_DOG if "dog" in body.name else EXACT
            assert np.abs(apart).max() / scale < limit, f"{hypothesis}: {signal}"


def test_a_trial_speaks_for_what_is_true_of_the_body(body: Robot):
    intact, *others = damages(body)
    plan = TrialPlan("trial", "before", swung(body, STEPS), STEPS, 0)
    trial = in_memory(body)(SimulatedRobot(body, intact), plan)
    evidence = LossTable(Simulator(body, 1), SEGMENT_PREDICTION)
    losses = evidence.losses([intact, *others], [trial]).mean(axis=1)

    assert losses[0] < 1e-8
    assert losses[1:].min() > 1e3 * losses[0]
    for known in (trial, lacking(trial, BASE)):
        assert prediction_error(body, [known], 1) < 0.01  # so that calibration leaves it as it is


def test_a_log_holds_the_robot_and_its_trial(body: Robot, tmp_path: Path):
    samples = list(SimulatedRobot(body).run(plan_of(body, 20).controller, 20))
    path = tmp_path / "a.mcap"
    write_trial(path, body, plan_of(body, 20), samples, TrialHeader(Settings()))
    log = read_log(path)
    again, logged = robot_of(log), collect(body.anatomy.names, samples)

    assert (again.anatomy, again.root) == (body.anatomy, body.root)
    for signal in SIGNALS:
        np.testing.assert_array_equal(log.trial.trajectory[signal], logged[signal])


def test_the_frames_of_a_log_are_where_the_bodies_are(body: Robot):
    run = happened(body, INTACT)
    told = ("joint_positions", "base_position", "base_orientation")
    (_, frames), _ = Kinematics(body).transforms({signal: run[signal] for signal in told})
    root = body_names(body.model).index(body.root)

    np.testing.assert_allclose(frames[:, 7 * root : 7 * root + 3], run["base_position"], atol=1e-6)
    xyzw = np.roll(run["base_orientation"], -1, axis=1)
    cosines = np.abs((frames[:, 7 * root + 3 : 7 * root + 7] * xyzw).sum(axis=1))
    np.testing.assert_allclose(cosines, 1, atol=1e-5)


def test_across_a_gap_a_damaged_body_still_moves(body: Robot):
    hidden = parse(f"break:{body.anatomy.joints[-1].name}", body.anatomy)
    gap = draw_gap(body, 0.05, np.random.default_rng(0))
    run = happened(body, hidden, gap)

    assert all(np.isfinite(run[signal]).all() for signal in SIGNALS)
    assert np.ptp(run["base_position"], axis=0).max() > 1e-3


def test_a_calibrated_model_of_it_has_its_parts(body: Robot):
    said = with_parameters(body, nominal(body))

    assert (said.anatomy.names, said.root) == (body.anatomy.names, body.root)
    for one, own in zip(said.anatomy.joints, body.anatomy.joints, strict=True):
        assert dataclasses.replace(one, limits=own.limits) == own
        np.testing.assert_allclose(one.limits, own.limits, rtol=1e-5)  # six digits
    np.testing.assert_allclose(said.model.body_mass, body.model.body_mass, rtol=1e-4)
    np.testing.assert_allclose(said.model.actuator_gainprm, body.model.actuator_gainprm, rtol=1e-4)


def test_nobody_has_fallen_at_the_start_and_a_swimmer_never_does(body: Robot):
    run = happened(body, INTACT)

    assert first_falls(run, UP, body.standing_height) > 0
    if "swimmer" in body.name:
        assert first_falls(run, UP, body.standing_height) == STEPS


def exported(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch, *, upright: bool = False
) -> Robot:
    """Returns the robot of a walker of dm_control.locomotion."""
    monkeypatch.setenv("MUJOCO_GL", "disable")  # without an OpenGL library
    walkers = importlib.import_module("dm_control.locomotion.walkers")
    mjcf = importlib.import_module("dm_control.mjcf")
    walker = getattr(walkers, name)()
    if upright:
        walker.root_body.quat = walker.upright_pose.xquat
    mjcf.export_with_assets(walker.mjcf_model, str(folder), "walker.xml")
    return load_mjcf(folder / "walker.xml", MjcfSettings(base="free"))


@pytest.mark.bodies
@pytest.mark.parametrize("name", ["Ant", "CMUHumanoidPositionControlledV2020"])
def test_a_freed_walker_is_a_robot_whose_predictions_are_exact(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    robot = exported(tmp_path, name, monkeypatch)
    (driver,) = random_controllers(robot, 1)

    found = exactness(robot, INTACT, driver, steps=40)

    assert not robot.has_fixed_base
    assert robot.model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert (found.prediction, found.displacement) == (0, 0)


@pytest.mark.bodies
def test_a_humanoid_in_the_upright_pose_of_its_walker_stands_on_its_legs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    name = "CMUHumanoidPositionControlledV2020"
    robot = exported(tmp_path, name, monkeypatch, upright=True)
    data = mujoco.MjData(robot.model)
    mujoco.mj_kinematics(robot.model, data)

    assert data.body("head").xpos[2] > data.body("root").xpos[2] + 0.3
    assert data.body("lfoot").xpos[2] < data.body("root").xpos[2] - 0.5
