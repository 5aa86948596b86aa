import json

import mujoco
import numpy as np

from selfmodel.report.scene import bodies_of, geometry_of
from selfmodel.robot.robot import Robot


def test_every_body_of_the_robot_has_its_shapes_and_the_world_has_none(robot: Robot):
    geometry = geometry_of(robot)

    assert geometry["bodies"] == [robot.model.body(i).name for i in bodies_of(robot)]
    assert "world" not in geometry["bodies"]
    assert {shape["body"] for shape in geometry["shapes"]} == set(range(len(geometry["bodies"])))
    assert geometry["bodies"][geometry["root"]] == robot.root
    json.dumps(geometry, allow_nan=False)


def test_a_shape_has_the_place_and_size_of_its_geom(quadruped: Robot):
    (torso,) = [one for one in geometry_of(quadruped)["shapes"] if one["type"] == "box"]
    (geom,) = np.flatnonzero(quadruped.model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)

    assert torso["size"] == quadruped.model.geom_size[geom].tolist()
    assert torso["position"] == quadruped.model.geom_pos[geom].tolist()
