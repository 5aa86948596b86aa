"""Tests of meshes that are too large for a log or have no file: stand-ins in the same place."""

import re
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.mjcf import meshes
from selfmodel.robot.mjcf.load import adapt_text, load_mjcf
from selfmodel.robot.mjcf.meshes import DRAWN_POINTS, directions
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_controllers
from tests.helpers.robots.menagerie import menagerie, stl

RINGS = 24
"""Meshes of 58 kB each."""


Adapt = Callable[..., Robot]


@pytest.fixture
def adapted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Adapt:
    """Returns a function that makes the robot of a package under a limit of its files."""

    def made(limit: int, *, meshes_collide: bool = False) -> Robot:
        folder = tmp_path / "go"
        if not folder.exists():
            menagerie(tmp_path, RINGS, meshes_collide=meshes_collide)
        monkeypatch.setattr(meshes, "MAX_ASSET_BYTES", limit)
        files = {f"../meshes/{f.name}": f.read_bytes() for f in (folder / "meshes").iterdir()}
        text = (folder / "xml" / "go.xml").read_text(encoding="utf-8")
        return adapt_text("go", text, files, MjcfSettings())

    return made


def points(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Returns the vertices of a mesh geom in the reference pose, in the world frame."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(float)
    return vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def meshed(model: mujoco.MjModel) -> np.ndarray:
    return np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)


def reach(cloud: np.ndarray) -> np.ndarray:
    """Returns how far points reach in many directions, m."""
    return (cloud @ directions(500).T).max(axis=0)


def test_a_large_visual_mesh_is_drawn_as_its_hull_in_the_same_place_and_moves_the_same(
    adapted: Adapt,
):
    whole, reduced = adapted(10**6), adapted(10**5)

    assert whole.assets
    assert not reduced.assets
    assert any("3 visual meshes are drawn as convex hulls" in note for note in reduced.notes)
    assert np.array_equal(whole.model.body_mass, reduced.model.body_mass)
    assert np.array_equal(motion(whole), motion(reduced))
    assert np.array_equal(meshed(whole.model), meshed(reduced.model))
    for geom in meshed(whole.model):
        before, after = points(whole.model, geom), points(reduced.model, geom)
        assert len(after) <= DRAWN_POINTS
        size = np.ptp(before, axis=0).max()
        assert np.allclose(reach(before), reach(after), atol=0.08 * size)
        assert np.all(reach(after) <= reach(before) + 1e-4 * size)


def test_colliding_meshes_become_the_hulls_with_which_they_collide(adapted: Adapt):
    whole, reduced = (adapted(limit, meshes_collide=True) for limit in (10**6, 10**4))

    assert not reduced.assets
    assert any("2 meshes with contacts are replaced" in note for note in reduced.notes)
    for geom in meshed(whole.model):
        if whole.model.geom_contype[geom]:
            before, after = points(whole.model, geom), points(reduced.model, geom)
            assert np.allclose(reach(before), reach(after), atol=1e-7)
    assert np.allclose(motion(whole)[:200], motion(reduced)[:200], atol=1e-5)


def test_hulls_leave_the_masses_that_the_meshes_gave_to_the_bodies(tmp_path: Path, adapted: Adapt):
    package = menagerie(tmp_path, RINGS, meshes_collide=True)
    file = package / "xml" / "go.xml"
    shaped = '<inertial (?!pos="0 0 0" mass="0.68")[^>]*/>'  # the hips have no geoms
    text = re.sub(shaped, "", file.read_text(encoding="utf-8"))
    file.write_text(text, encoding="utf-8")

    whole, reduced = adapted(10**6), adapted(10**4)

    assert not reduced.assets
    for name in ("body_mass", "body_inertia", "body_ipos"):
        before, after = getattr(whole.model, name), getattr(reduced.model, name)
        assert np.allclose(before, after, rtol=1e-9, atol=1e-12), name


def motion(robot: Robot, steps: int = 100) -> np.ndarray:
    """Returns the base's path under a random controller, ``(steps, 3)``, m."""
    (controller,) = random_controllers(robot, 1, seed=2)
    found = Simulator(robot, 1).run([(INTACT, controller)], steps, SIGNALS)
    return found.trajectory["base_position"][0]


@pytest.mark.parametrize("flat", [(1, 1, 0), (1, 0, 0)])
def test_a_flat_visual_mesh_is_drawn_too(
    tmp_path: Path, adapted: Adapt, flat: tuple[int, int, int]
):
    package = menagerie(tmp_path, RINGS)
    rng = np.random.default_rng(0)
    sheet = rng.uniform(-0.1, 0.1, (900, 3, 3)) * [1, 1, 1e-6] * (np.array(flat) + 1e-9)
    (package / "meshes" / "trunk.stl").write_bytes(stl(sheet))
    file = package / "xml" / "go.xml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace('file="trunk.stl"', 'file="trunk.stl" inertia="shell"'))

    reduced = adapted(10**4)

    trunk = int(meshed(reduced.model)[0])
    assert np.ptp(points(reduced.model, trunk), axis=0).max() == pytest.approx(0.2, rel=0.1)


def test_a_geom_that_is_fitted_to_a_mesh_stays_as_it_is(tmp_path: Path, adapted: Adapt):
    package = menagerie(tmp_path, RINGS)
    file = package / "xml" / "go.xml"
    text = file.read_text(encoding="utf-8")
    box = 'type="box" size="0.125 0.04 0.057"'
    file.write_text(text.replace(box, 'type="box" mesh="trunk" euler="0 0 0.1"'), encoding="utf-8")

    whole, reduced = adapted(10**6), adapted(10**5)

    (geom,) = np.flatnonzero(whole.model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    for name in ("geom_size", "geom_pos", "geom_quat"):
        before, after = getattr(whole.model, name)[geom], getattr(reduced.model, name)[geom]
        assert np.allclose(before, after, atol=1e-12)


def test_a_robot_without_the_files_of_its_visual_meshes_moves_the_same(tmp_path: Path):
    file = menagerie(tmp_path) / "xml" / "scene.xml"
    whole = load_mjcf(file)

    for mesh in (tmp_path / "go" / "meshes").iterdir():
        mesh.unlink()
    bare = load_mjcf(file)

    assert np.array_equal(motion(whole), motion(bare))
    assert any("3 visual meshes have no file" in note for note in bare.notes)


def test_each_body_is_drawn_as_the_box_of_its_inertia(tmp_path: Path):
    file = menagerie(tmp_path) / "xml" / "scene.xml"
    (tmp_path / "go" / "meshes" / "trunk.stl").unlink()

    model = load_mjcf(file).model
    trunk = model.body("trunk")
    boxes = [
        geom
        for geom in range(int(trunk.geomadr[0]), int(trunk.geomadr[0] + trunk.geomnum[0]))
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX and model.geom_group[geom] == 2
    ]

    assert len(boxes) == 1
    x, y, z = 2 * model.geom_size[boxes[0]]
    inertia = trunk.mass[0] / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    assert np.allclose(inertia, trunk.inertia)
    assert not model.geom_contype[boxes[0]]
