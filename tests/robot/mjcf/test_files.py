"""Tests of the folders that an MJCF may read: its own, that of its package, and the user's."""

from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings, read_settings
from selfmodel.robot.mjcf.untrusted import Folder, robot_folder, root_around
from tests.helpers.robots.menagerie import menagerie
from tests.robot.mjcf.awkward import CUBE, MESHED, mjcf

LIMIT = 1000


def put(file: Path, content: str = "mesh") -> Path:
    """Writes a file, and the folders around it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content, encoding="utf-8")
    return file


def content(folder: Folder, name: str) -> str:
    return folder.read(name, "a file", LIMIT).decode()


@pytest.mark.parametrize("inside", ["mjcf", "xml", "urdf"])
def test_a_folder_named_after_a_format_belongs_to_the_package_above_it(tmp_path: Path, inside: str):
    put(tmp_path / "go1" / "meshes" / "trunk.stl")
    put(tmp_path / "go1" / "common.xml", "common")
    put(tmp_path / "go1" / inside / "go1.xml")

    found = robot_folder(tmp_path / "go1" / inside)

    assert content(found, "../meshes/trunk.stl") == "mesh"
    assert content(found, "../common.xml") == "common"


def test_the_folder_above_is_not_read_in_another_layout(tmp_path: Path):
    put(tmp_path / "private" / "key.stl")
    put(tmp_path / "downloads" / "robot.xml")

    with pytest.raises(InputError, match=r"outside its own folder.* --set assets=DIR"):
        content(robot_folder(tmp_path / "downloads"), "../private/key.stl")


@pytest.mark.parametrize("above", [".", "..", "../.."])
def test_the_home_folder_and_those_around_it_belong_to_no_package(
    tmp_path: Path, above: str, monkeypatch: pytest.MonkeyPatch
):
    home = tmp_path / "users" / "me"
    put(home / above / "meshes" / "trunk.stl")
    put(home / above / "mjcf" / "robot.xml")
    monkeypatch.setenv("HOME", str(home))

    folder = home / above / "mjcf"

    assert root_around(folder) == folder


def test_a_link_that_leads_out_of_the_package_is_refused(tmp_path: Path):
    secret = put(tmp_path / "secret.stl")
    put(tmp_path / "go1" / "mjcf" / "go1.xml")
    (tmp_path / "go1" / "meshes").mkdir()
    (tmp_path / "go1" / "meshes" / "trunk.stl").symlink_to(secret)
    found = robot_folder(tmp_path / "go1" / "mjcf")

    assert not found.has("../meshes/trunk.stl")
    with pytest.raises(InputError, match="outside its own folder"):
        content(found, "../meshes/trunk.stl")


def test_a_loop_of_links_is_no_file(tmp_path: Path):
    (tmp_path / "mesh.stl").symlink_to(tmp_path / "mesh.stl")
    found = robot_folder(tmp_path)

    assert not found.has("mesh.stl")
    with pytest.raises(InputError, match="loop of links"):
        content(found, "mesh.stl")


@pytest.mark.parametrize(
    "name",
    [
        "../mesh.stl",
        "/etc/hostname",
        "../../../../../../etc/hostname",
        "a\0b",
        "a" * 300,
        "b/" * 9999,
    ],
)
def test_a_name_outside_of_everything_is_one_error(tmp_path: Path, name: str):
    (tmp_path / "assets").mkdir()
    put(tmp_path / "mesh.stl")

    found = robot_folder(tmp_path / "other" / "robot", str(tmp_path / "assets"))

    assert not found.has(name)
    with pytest.raises(InputError):
        content(found, name)


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("menagerie", "../../menagerie/go1/assets/trunk.stl"),
        ("menagerie/go1", "../../menagerie/go1/assets/trunk.stl"),
        ("menagerie/go1", "assets/trunk.stl"),
        ("menagerie/go1/assets", "assets/trunk.stl"),
        ("menagerie/go1/assets", "trunk.stl"),
        ("menagerie/go1/assets", "/elsewhere/trunk.stl"),
    ],
)
def test_files_are_found_in_the_folder_that_the_user_gives(tmp_path: Path, given: str, name: str):
    put(tmp_path / "menagerie" / "go1" / "assets" / "trunk.stl")

    found = robot_folder(tmp_path / "wheel" / "xmls" / "go1", str(tmp_path / given))

    assert content(found, name) == "mesh"


@pytest.mark.parametrize(
    "assets", ['"/"', r'"a\u0000b"', '"/etc"', '"../../../../../../../../../.."', "3"]
)
def test_a_settings_file_cannot_open_the_whole_disk(tmp_path: Path, assets: str):
    put(tmp_path / "robot.toml", f"assets = {assets}")

    with pytest.raises(InputError, match=r"robot\.toml: assets "):
        read_settings(tmp_path / "robot.xml")


def test_a_settings_file_that_names_a_loop_of_links_is_refused(tmp_path: Path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    put(tmp_path / "robot.toml", 'assets = "loop"')

    with pytest.raises(InputError, match="assets needs a folder"):
        load_mjcf(put(tmp_path / "robot.xml", mjcf()))


def test_a_model_of_a_settings_folder_loads(tmp_path: Path):
    text = mjcf(more='<asset><mesh name="m" file="../shapes/m.obj"/></asset>', torso=MESHED)
    put(tmp_path / "shapes" / "m.obj", CUBE)
    robot = put(tmp_path / "mine" / "robot.xml", text)

    with pytest.raises(InputError, match=r"\.\./shapes/m\.obj"):
        load_mjcf(robot)
    assert load_mjcf(robot, MjcfSettings(assets=str(tmp_path / "shapes"))).assets

    put(tmp_path / "mine" / "robot.toml", 'assets = "../shapes"')
    assert load_mjcf(robot).assets


@pytest.mark.parametrize("name", ["go.xml", "scene.xml"])
def test_a_package_in_the_layout_of_menagerie_loads_without_settings(tmp_path: Path, name: str):
    robot = load_mjcf(menagerie(tmp_path) / "xml" / name)

    assert robot.root == "trunk"
    assert len(robot.anatomy.joints) == 12
