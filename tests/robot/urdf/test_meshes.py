"""Tests of the meshes of a URDF: where they are searched, and what is refused."""

from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.files import robot_folder
from selfmodel.robot.mjcf.untrusted import parse_xml
from selfmodel.robot.urdf import read_urdf
from tests.robot.urdf.samples import CUBE, link, read, urdf

MESH = '<{0}><geometry><mesh filename="{1}"/></geometry></{0}>'


def package(folder: Path, mesh: str = "meshes/leg.obj") -> Path:
    """Writes a ROS package, and returns the folder of its URDF."""
    home = folder / "walker_description" / "urdf"
    home.mkdir(parents=True)
    path = home.parent / mesh
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(CUBE)
    return home


@pytest.mark.parametrize(
    "uri",
    [
        "package://walker_description/meshes/leg.obj",
        "model://walker_description/meshes/leg.obj",
        "../meshes/leg.obj",
        "..\\meshes\\leg.obj",
        "package://walker_description/meshes/leg.dae",
        "file://{home}/../meshes/leg.obj",
    ],
)
def test_a_mesh_of_a_ros_package_is_found(uri: str, tmp_path: Path):
    home = package(tmp_path)
    text = urdf(link("a", 1, MESH.format("collision", uri.format(home=home))))

    document = read_urdf(parse_xml(text.encode()), robot_folder(home))

    assert document.assets == {"leg.obj": CUBE.encode()}
    assert [mesh.get("filename") for mesh in document.root.iter("mesh")] == ["leg.obj"]


def test_a_mesh_of_another_package_is_found_in_the_folder_of_the_user(tmp_path: Path):
    home = package(tmp_path / "here")
    other = tmp_path / "there" / "hands" / "meshes"
    other.mkdir(parents=True)
    (other / "hand.obj").write_text(CUBE)
    text = urdf(link("a", 1, MESH.format("collision", "package://hands/meshes/hand.obj")))

    document = read_urdf(parse_xml(text.encode()), robot_folder(home, str(tmp_path / "there")))

    assert set(document.assets) == {"hand.obj"}


@pytest.mark.parametrize(
    "uri",
    [
        "/etc/hostname.obj",
        "file:///etc/hostname.obj",
        "../../../secret.obj",
        "package://x/../../secret.obj",
        "package://x/%2e%2e/%2e%2e/secret.obj",
        "leg\x00.obj".replace("\x00", "&#9;"),
        "x" * 10_000 + ".obj",
        "http://example.org/leg.obj",
        "",
    ],
)
def test_a_collision_without_a_file_in_the_folders_is_refused_with_the_remedy(
    uri: str, tmp_path: Path
):
    home = package(tmp_path / "far" / "away")
    (tmp_path / "secret.obj").write_text(CUBE)
    text = urdf(link("a", 1, MESH.format("collision", uri)))

    with pytest.raises(InputError, match="--set assets=DIR") as refusal:
        read_urdf(parse_xml(text.encode()), robot_folder(home))

    assert len(str(refusal.value)) < 500


def test_visual_meshes_that_are_missing_or_in_another_format_are_left_out_with_a_note():
    meshes = [MESH.format("visual", name) for name in ("a.obj", "gone.stl", "b.dae", "c.dae")]

    document = read(urdf(link("a", 1, "".join(meshes))), {"a.obj": CUBE, "b.dae": "<COLLADA/>"})

    assert set(document.assets) == {"a.obj"}
    assert len(list(document.root.iter("visual"))) == 1
    assert any("1 visual meshes" in note and "gone.stl" in note for note in document.notes)
    assert any("2 visual meshes" in note and ".dae" in note for note in document.notes)


def test_two_meshes_of_one_name_are_two_files_and_one_mesh_is_read_once():
    names = ["left/leg.obj", "right/leg.obj", "left/leg.obj"]
    text = urdf(link("a", 1, "".join(MESH.format("collision", name) for name in names)))

    document = read(text, {"left/leg.obj": CUBE, "right/leg.obj": CUBE + "\n"})

    used = [mesh.get("filename") for mesh in document.root.iter("mesh")]
    assert used == ["leg.obj", "leg_2.obj", "leg.obj"]
    assert set(document.assets) == {"leg.obj", "leg_2.obj"}
