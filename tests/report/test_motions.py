import numpy as np
import pytest

from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.report.motions import Motion, TrialMotions, motions_as_json
from selfmodel.report.scene import geometry_of
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.arms import quadruped_on_a_stand
from tests.report.decoding import angle, decoded

STEPS = 30


def moved(robot: Robot) -> Behaviour:
    (controller,) = random_controllers(robot, 1)
    batch = Simulator(robot, 1).run([(INTACT, controller)], STEPS, SIGNALS).behaviour
    return Behaviour(batch.names, batch.time, {one: batch[one][0] for one in SIGNALS})


def drawn_angles(robot: Robot, shot: dict) -> np.ndarray:
    """The angles of the first motion by the rotations of its bodies, ``(frames, hinges)``."""
    geometry = geometry_of(robot)
    rotation = decoded(shot["motions"][0]["rotation"])
    frames = rotation.reshape(len(shot["time"]), len(geometry["bodies"]), 4)
    return np.array(
        [
            [angle(hinge, one[hinge["parent"]], one[hinge["body"]]) for hinge in geometry["turned"]]
            for one in frames
        ]
    )


@pytest.mark.parametrize("make", ["registered", "on a stand"])
def test_the_angles_of_a_motion_are_those_of_the_log(make: str, robot: Robot):
    if make == "on a stand":
        robot = quadruped_on_a_stand()
    behaviour = moved(robot)

    (shot,) = motions_as_json(robot, [TrialMotions("a", (Motion("measured", INTACT, behaviour),))])

    logged = behaviour["joint_positions"]
    turned = [robot.anatomy.hinges.index(one["name"]) for one in geometry_of(robot)["turned"]]
    assert turned
    assert np.abs(decoded(shot["motions"][0]["angles"]) - logged).max() < 1e-4
    assert np.abs(drawn_angles(robot, shot) - logged[:, turned]).max() < 2e-4
    assert shot["time"] == behaviour.time.tolist()
    assert shot["motions"][0]["travelled"] == behaviour["base_position"][:, 0].tolist()


def test_detached_and_jammed_bodies_of_the_hypothesis_are_named(quadruped: Robot):
    hypothesis = parse("break:front_left_knee+jam:back_right_shoulder", quadruped.anatomy)

    (shot,) = motions_as_json(
        quadruped, [TrialMotions("a", (Motion("b", hypothesis, moved(quadruped)),))]
    )

    bodies = geometry_of(quadruped)["bodies"]
    (motion,) = shot["motions"]
    assert [bodies[i] for i in motion["detached"]] == ["front_left_lower"]
    assert [bodies[i] for i in motion["jammed"]] == ["back_right_upper"]


def test_a_long_trial_loses_steps_but_neither_its_first_nor_its_last(
    quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("selfmodel.report.motions.MAX_POSES", STEPS * 9 // 4)
    behaviour = moved(quadruped)

    (shot,) = motions_as_json(
        quadruped, [TrialMotions("a", (Motion("measured", INTACT, behaviour),))]
    )

    assert len(shot["time"]) <= STEPS // 4 + 2
    assert [shot["time"][0], shot["time"][-1]] == [behaviour.time[0], behaviour.time[-1]]
