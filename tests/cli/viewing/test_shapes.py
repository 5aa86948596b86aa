"""Tests of geoms as shapes of Rerun: where MuJoCo has them."""

import mujoco
import numpy as np
import pytest

from selfmodel.cli.viewing.shapes import shape_of

pytest.importorskip("rerun", reason="the extra rerun is not installed")

MODEL = mujoco.MjModel.from_xml_string("""
<mujoco>
  <asset>
    <mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
    <hfield name="hills" nrow="2" ncol="2" size="1 1 1 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <geom type="hfield" hfield="hills"/>
    <body>
      <geom type="capsule" fromto="0 0 1  0 1 1" size="0.1"/>
      <geom type="cylinder" fromto="0 0 1  0 1 1" size="0.1"/>
      <geom type="sphere" pos="1 2 3" size="0.2"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3"/>
      <geom type="box" pos="1 0 0" size="0.1 0.2 0.3" euler="0 0 90"/>
      <geom type="mesh" mesh="wedge" pos="5 0 0"/>
    </body>
  </worldbody>
</mujoco>
""")
PLANE, HFIELD, CAPSULE, CYLINDER, SPHERE, ELLIPSOID, BOX, MESH = range(8)


def parts(geom: int) -> dict[str, list]:
    """The components of a shape, by name."""
    shape = shape_of(MODEL, geom, (1, 2, 3, 255), transparent=False)
    return {
        batch.component_descriptor().component.partition(":")[2]: batch.as_arrow_array().to_pylist()
        for batch in shape.as_component_batches()
    }


def turned(found: dict[str, list], vector: list[float]) -> np.ndarray:
    """A vector in the frame of a shape, turned into the frame of its body."""
    out = np.empty(3)
    quaternion = np.roll(np.array(found["quaternions"][0], dtype=float), 1)
    mujoco.mju_rotVecQuat(out, np.array(vector), quaternion)
    return out


@pytest.mark.parametrize("geom", [PLANE, HFIELD])
def test_the_ground_is_no_shape(geom: int):
    assert shape_of(MODEL, geom, (0, 0, 0, 255), transparent=False) is None


def test_a_capsule_reaches_from_one_end_to_the_other():
    found = parts(CAPSULE)
    start = np.array(found["translations"][0])
    end = start + turned(found, [0, 0, found["lengths"][0]])

    assert sorted([start.round(6).tolist(), end.round(6).tolist()]) == [[0, 0, 1], [0, 1, 1]]
    assert found["radii"] == pytest.approx([0.1])


def test_a_cylinder_is_around_its_middle():
    found = parts(CYLINDER)

    assert found["centers"][0] == pytest.approx([0, 0.5, 1])
    assert np.abs(turned(found, [0, 0, found["lengths"][0]])) == pytest.approx([0, 1, 0], abs=1e-6)


def test_other_shapes_have_their_sizes_and_places():
    assert parts(SPHERE)["half_sizes"][0] == pytest.approx([0.2, 0.2, 0.2])
    assert parts(SPHERE)["centers"][0] == pytest.approx([1, 2, 3])
    assert parts(ELLIPSOID)["half_sizes"][0] == pytest.approx([0.1, 0.2, 0.3])
    box = parts(BOX)
    assert box["centers"][0] == pytest.approx([1, 0, 0])
    assert np.abs(turned(box, box["half_sizes"][0])) == pytest.approx([0.2, 0.1, 0.3], abs=1e-6)


def test_a_mesh_has_its_vertices_in_the_frame_of_its_body():
    vertices = np.array(parts(MESH)["vertex_positions"])

    assert sorted(vertices.round(5).tolist()) == [[5, 0, 0], [5, 0, 1], [5, 1, 0], [6, 0, 0]]


def test_a_simulated_body_is_transparent():
    shape = shape_of(MODEL, BOX, (1, 2, 3, 255), transparent=True)

    assert shape.fill_mode.as_arrow_array().to_pylist() != parts(BOX)["fill_mode"]
