"""Tests of payloads: a mass on the root body, at a place."""

import mujoco
import numpy as np
import pytest

from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.faults.world import PAYLOAD
from selfmodel.robot.robot import Robot
from tests.faults.test_build import assert_same_paths, follow

STEPS = 30
"""Control steps of a comparison: later, contacts amplify the tolerance of the solver."""


def built(robot: Robot, text: str) -> mujoco.MjModel:
    return build(robot, parse(text, robot.anatomy)).model


def centre_of_mass(model: mujoco.MjModel) -> np.ndarray:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.subtree_com[0].copy()


@pytest.mark.parametrize("place", ["", ":front", ":back"])
def test_a_payload_is_that_fraction_of_the_robot_s_mass(robot: Robot, place: str):
    loaded = built(robot, f"payload{place}=0.2")

    assert loaded.body_subtreemass[0] == pytest.approx(1.2 * robot.model.body_subtreemass[0])
    assert loaded.body_mass[2:] == pytest.approx(robot.model.body_mass[2:])


def test_a_payload_moves_the_centre_of_mass_to_its_place(robot: Robot):
    front, middle, back = (
        centre_of_mass(built(robot, f"payload{place}=0.2"))[0] for place in (":front", "", ":back")
    )

    assert front > middle + 0.02
    assert back < middle - 0.02


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

    assert_same_paths(follow(quadruped, loaded, STEPS), follow(quadruped, spec.compile(), STEPS))


def test_a_payload_is_a_fraction_of_the_healthy_mass_beside_a_broken_limb(quadruped: Robot):
    broken = built(quadruped, "break:front_left_shoulder")
    both = built(quadruped, "break:front_left_shoulder+payload=0.5")

    added = both.body("torso").mass - broken.body("torso").mass
    assert added == pytest.approx(0.5 * quadruped.model.body_subtreemass[0])


def test_a_robot_with_a_fixed_base_has_no_payload():
    robot = Robot(
        "arm",
        """<mujoco><worldbody><body name="stand"><geom size="0.1"/><body name="arm">
          <joint name="elbow" axis="0 1 0" range="-60 60"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.02"/></body></body></worldbody>
        <actuator><position name="elbow" joint="elbow" ctrlrange="-1 1"/></actuator></mujoco>""",
        0.02,
    )

    assert PAYLOAD.parts(robot.anatomy) == ()
