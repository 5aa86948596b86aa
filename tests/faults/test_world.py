"""Tests of a control delay that grew, and of payloads."""

import mujoco
import numpy as np
import pytest

from selfmodel.controllers.playback import Playback
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.robot.anatomy import added_steps
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import Segments, cut_segments
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from tests.faults.test_build import assert_same_paths, built, follow
from tests.helpers.calibration import late
from tests.helpers.drivers import random_motion
from tests.helpers.robots.arms import arm

STEPS = 60
STATES = tuple(
    signal for signal in SIGNALS if signal not in ("sensors", "commands", "joint_efforts")
)


def playback(robot: Robot) -> Playback:
    return Playback(robot.anatomy.motors, random_motion(robot, STEPS))


def segments_of(logged: Trajectory, starts: np.ndarray) -> Segments:
    """Segments of ten steps of a log, which predict all of the state."""
    states = {signal: logged[signal] for signal in STATES}
    return cut_segments(logged, states, starts, 10, STATES)


@pytest.mark.parametrize(("own", "added"), [(0, 1), (0, 3), (2, 2), (0.5, 2), (1.5, 1)])
def test_a_grown_delay_is_the_robot_with_that_delay_beside_robots_without_it(
    quadruped: Robot, own: float, added: int
):
    robot, truth = late(quadruped, own), late(quadruped, own + added)
    hypotheses = [INTACT, parse(f"delay={added}", robot.anatomy), INTACT]
    driver = playback(robot)
    runs = Simulator(robot, 1).run([(each, driver) for each in hypotheses], STEPS, SIGNALS)
    expected = Simulator(truth, 1).run([(INTACT, driver)], STEPS, SIGNALS).trajectory
    prompt = Simulator(robot, 1).run([(INTACT, driver)], STEPS, SIGNALS).trajectory
    for signal in SIGNALS:
        np.testing.assert_array_equal(runs.trajectory[signal][1], expected[signal][0])
        for row in (0, 2):
            np.testing.assert_array_equal(runs.trajectory[signal][row], prompt[signal][0])
    assert not np.array_equal(expected["base_position"], prompt["base_position"])

    logged = expected.run(0)
    segments = segments_of(logged, np.array([0, 10, 30]))
    predicted = Simulator(robot, 1).predict(hypotheses, segments).trajectory
    alone = Simulator(truth, 1).predict([INTACT], segments).trajectory
    for signal in STATES:
        np.testing.assert_array_equal(predicted[signal][1], alone[signal][0])


def test_a_delay_grows_by_whole_steps_up_to_the_largest_delay():
    assert [added_steps(0, added) for added in (0.0, 0.4, 1.6, 3.0)] == [0, 0, 2, 3]
    assert [added_steps(delay, 3.0) for delay in (2, 2.5, 3, 5)] == [3, 2, 2, 0]


LOADED_STEPS = 30
"""Control steps of a comparison: later, contacts amplify the tolerance of the solver."""


@pytest.mark.parametrize(("place", "at"), [("", 0.0), (":front", 0.4), (":back", -0.4)])
def test_a_payload_is_a_torso_with_that_inertia(quadruped: Robot, place: str, at: float):
    spec, own = mujoco.MjSpec.from_string(quadruped.mjcf), quadruped.model.body("torso")
    load = 0.3 * float(quadruped.model.body_subtreemass[0])
    share = load / (own.mass[0] + load)
    torso = spec.body("torso")
    torso.explicitinertial, torso.iquat = True, [1, 0, 0, 0]
    torso.mass = own.mass[0] + load
    torso.ipos = [at * share, 0, 0]
    torso.inertia = own.inertia + own.mass[0] * share * at**2 * np.array([0, 1, 1])
    loaded = built(quadruped, f"payload{place}=0.3")

    assert_same_paths(
        follow(quadruped, loaded, LOADED_STEPS), follow(quadruped, spec.compile(), LOADED_STEPS)
    )


def test_a_payload_is_a_fraction_of_the_healthy_mass_beside_a_broken_limb(quadruped: Robot):
    broken = built(quadruped, "break:front_left_shoulder")
    both = built(quadruped, "break:front_left_shoulder+payload=0.5")

    added = both.body("torso").mass - broken.body("torso").mass
    assert added == pytest.approx(0.5 * quadruped.model.body_subtreemass[0])


def test_a_load_is_a_mass_in_kg_at_the_centre_of_a_link_of_an_arm():
    robot = arm()
    spec = mujoco.MjSpec.from_string(robot.mjcf)
    link = robot.model.body("link4")
    body = spec.body("link4")
    body.explicitinertial, body.mass = True, link.mass[0] + 0.7
    body.ipos, body.inertia, body.iquat = link.ipos, link.inertia, link.iquat
    loaded = built(robot, "load:joint4=0.7")
    moved = follow(robot, loaded, STEPS)
    assert_same_paths(moved, follow(robot, spec.compile(), STEPS))
    bare = follow(robot, built(robot, "intact"), STEPS)
    assert np.abs(moved["joint2"] - bare["joint2"]).max() > 1e-3
