from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from scipy.spatial.transform import Rotation

from selfmodel.logs.viewers import _roll_pitch_yaw, urdf
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.mjcf.untrusted import InMemory, parse_xml
from selfmodel.robot.robot import Robot
from selfmodel.robot.urdf import read_urdf
from selfmodel.tasks import ROBOTS


def numbers(element: ET.Element | None, name: str) -> np.ndarray:
    assert element is not None
    return np.array([float(number) for number in element.attrib[name].split()])


def matrix_of(quaternion: np.ndarray) -> np.ndarray:
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


@pytest.fixture(params=["biped", *sorted(ROBOTS)])
def drawn(request: pytest.FixtureRequest, biped: Robot) -> Robot:
    """The biped, and each registered robot."""
    return biped if request.param == "biped" else ROBOTS[request.param].robot()


def test_shapes_stand_where_the_geoms_do(drawn: Robot):
    tree = ET.fromstring(urdf(drawn))  # noqa: S314 - our own text
    model = drawn.model
    for link in tree.findall("link"):
        if "__" in link.attrib["name"]:
            assert len(link) == 0
            continue
        body = model.body(link.attrib["name"])
        first, count = body.geomadr[0], body.geomnum[0]
        geoms = range(first, first + count)
        for geom, visual in zip(geoms, link.findall("visual"), strict=True):
            origin = visual.find("origin")
            turn = Rotation.from_euler("xyz", numbers(origin, "rpy")).as_matrix()
            place = numbers(origin, "xyz")
            np.testing.assert_allclose(place, model.geom_pos[geom], atol=1e-7)
            np.testing.assert_allclose(turn, matrix_of(model.geom_quat[geom]), atol=1e-7)


@pytest.mark.parametrize("pitch", [-np.pi / 2, -1.0, 0.0, np.pi / 2])
@pytest.mark.parametrize("roll", [-2.0, 0.0, 0.7])
@pytest.mark.parametrize("yaw", [-3.0, 0.0, 1.1])
def test_a_turn_is_told_in_angles_even_straight_up_and_down(roll: float, pitch: float, yaw: float):
    turn = Rotation.from_euler("xyz", (roll, pitch, yaw))
    told = Rotation.from_euler("xyz", _roll_pitch_yaw(turn.as_quat(scalar_first=True)))
    np.testing.assert_allclose(told.as_matrix(), turn.as_matrix(), atol=1e-7)


def inertia_in_body(model: mujoco.MjModel, name: str) -> np.ndarray:
    """The inertia of a body about its centre of mass, in the body's frame."""
    body = model.body(name)
    turn = matrix_of(body.iquat)
    return turn @ np.diag(body.inertia) @ turn.T


def from_root(model: mujoco.MjModel, data: mujoco.MjData, root: str) -> tuple[np.ndarray, ...]:
    """Positions and rotations of all bodies in the frame of the root body, by the root's order."""
    turn = data.body(root).xmat.reshape(3, 3)
    first = model.body(root).id
    places = (data.xpos[first:] - data.body(root).xpos) @ turn
    return places, turn.T @ data.xmat[first:].reshape(-1, 3, 3)


@settings(
    max_examples=3, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 2**32 - 1))
def test_read_back_it_is_a_robot_with_the_same_bodies_in_any_pose(drawn: Robot, seed: int):
    root = parse_xml(urdf(drawn).encode())
    text = read_urdf(root, InMemory({}), MjcfSettings(base="fixed")).text
    before, after = drawn.model, mujoco.MjModel.from_xml_string(text)
    first = before.body(drawn.root).id
    names = [before.body(body).name for body in range(first, before.nbody)]
    hinges = drawn.anatomy.hinges
    here, there = mujoco.MjData(before), mujoco.MjData(after)
    for hinge, angle in zip(
        hinges, np.random.default_rng(seed).uniform(-3, 3, len(hinges)), strict=True
    ):
        here.joint(hinge).qpos[0] = there.joint(hinge).qpos[0] = angle
    mujoco.mj_kinematics(before, here)
    mujoco.mj_kinematics(after, there)

    assert [after.body(body).name for body in range(1, after.nbody)] == names
    assert [after.joint(joint).name for joint in range(after.njnt)] == list(hinges)
    for hinge in hinges:
        np.testing.assert_allclose(after.joint(hinge).range, before.joint(hinge).range, atol=1e-8)
        assert after.joint(hinge).limited == before.joint(hinge).limited
    for name in names:
        np.testing.assert_allclose(after.body(name).mass, before.body(name).mass, rtol=1e-8)
        expected = inertia_in_body(before, name)
        np.testing.assert_allclose(inertia_in_body(after, name), expected, rtol=1e-6, atol=1e-9)
    placed, expected = (
        from_root(model, data, drawn.root) for model, data in ((after, there), (before, here))
    )
    for one, other in zip(placed, expected, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)
