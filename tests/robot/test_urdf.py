"""URDF files: MuJoCo's bodies to the last digits, servos, a stance, and clear refusals."""

import json
import math
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.errors import InputError
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import checked_settings
from selfmodel.robot.mjcf.untrusted import InMemory, parse_xml, robot_folder
from selfmodel.robot.mjcf.work import Work
from selfmodel.robot.urdf import MAX_LINK_DEPTH, read_urdf
from tests.helpers.command import selfmodel
from tests.robot.mjcf.awkward import CUBE

INERTIAL = """<inertial><mass value="{mass}"/>
<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>"""
BALL = '<collision><geometry><sphere radius="0.03"/></geometry></collision>'
BOX = '<collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision>'
MESH = '<{0}><geometry><mesh filename="{1}"/></geometry></{0}>'


def link(name: str, mass: float = 1.0, body: str = "") -> str:
    inertial = INERTIAL.format(mass=mass, i=0.01 * mass) if mass else ""
    return f'<link name="{name}">{inertial}{body}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    *,
    kind: str = "revolute",
    xyz: str = "0 0 -0.2",
    axis: str = "0 1 0",
    more: str = "",
    **limits: float,
) -> str:
    known = {"lower": -1.0, "upper": 1.0, "effort": 10.0, "velocity": 10.0} | limits
    limit = " ".join(f'{key}="{value}"' for key, value in known.items())
    return f"""<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{xyz}"/><axis xyz="{axis}"/><limit {limit}/>{more}</joint>"""


def leg(side: str, y: float) -> str:
    """Returns a leg with hip, knee and a foot on a fixed joint."""
    return (
        link(f"{side}_thigh")
        + link(f"{side}_shin", 0.5)
        + link(f"{side}_foot", 0.1, BALL)
        + joint(f"{side}_hip", "trunk", f"{side}_thigh", xyz=f"0 {y} 0")
        + joint(f"{side}_knee", f"{side}_thigh", f"{side}_shin", lower=-2.0, upper=-0.5)
        + joint(f"{side}_ankle", f"{side}_shin", f"{side}_foot", kind="fixed")
    )


def urdf(*parts: str) -> str:
    return f'<robot name="walker">{"".join(parts)}</robot>'


WALKER = urdf(link("trunk", 4.0, BOX), leg("left", 0.1), leg("right", -0.1))
"""A two-legged robot whose feet are fixed links."""


def with_parts(*parts: str) -> str:
    """Returns the two-legged robot with further links and joints."""
    return WALKER.replace("</robot>", "".join(parts) + "</robot>")


def converted(text: str, files: dict[str, str] | None = None, **given: object) -> Work:
    """Returns the MJCF of a URDF in memory."""
    return read_urdf(parse_xml(text.encode()), InMemory(files or {}), checked_settings(given))


def fixed(*parts: str, **given: object) -> mujoco.MjModel:
    """Returns the compiled MJCF of a URDF with a fixed base."""
    return mujoco.MjModel.from_xml_string(converted(urdf(*parts), base="fixed", **given).text)


def written(folder: Path, text: str = WALKER, toml: str = "") -> Path:
    path = folder / "walker.urdf"
    path.write_text(text)
    path.with_suffix(".toml").write_text(toml)
    return path


NUMBER = st.floats(-1, 1).map(lambda value: round(value, 9))
VECTOR = st.lists(NUMBER, min_size=3, max_size=3).map(lambda v: " ".join(map(repr, v)))
AXIS = VECTOR.filter(lambda text: np.linalg.norm(np.fromstring(text, sep=" ")) > 0.1)
MOMENT = st.floats(1.0, 1.5).map(lambda value: round(value, 9))


@st.composite
def trees(draw: st.DrawFn) -> str:
    """A URDF with links at any place, joints of all kinds, and any inertia."""
    parts = []
    for number in range(draw(st.integers(2, 7))):
        moments = "".join(f'{name}="{draw(MOMENT)}" ' for name in ("ixx", "iyy", "izz"))
        products = "".join(f'{name}="{draw(NUMBER) / 10}" ' for name in ("ixy", "ixz", "iyz"))
        parts.append(
            f'<link name="l{number}"><inertial><origin xyz="{draw(VECTOR)}" rpy="{draw(VECTOR)}"/>'
            f'<mass value="{draw(MOMENT)}"/><inertia {moments}{products}/></inertial>'
            f'<collision><origin xyz="{draw(VECTOR)}" rpy="{draw(VECTOR)}"/>'
            f'<geometry><cylinder radius="0.123456789" length="0.3"/></geometry></collision></link>'
        )
        if number:
            kind = draw(st.sampled_from(["revolute", "continuous", "fixed"]))
            parent = draw(st.integers(0, number - 1))
            parts.append(
                f'<joint name="j{number}" type="{kind}"><parent link="l{parent}"/>'
                f'<child link="l{number}"/><origin xyz="{draw(VECTOR)}" rpy="{draw(VECTOR)}"/>'
                f'<axis xyz="{draw(AXIS)}"/><dynamics damping="0.12" friction="0.034"/>'
                f'<limit lower="-1.23456789" upper="0.987654321" effort="3" velocity="5"/></joint>'
            )
    return urdf(*parts)


def posed(model: mujoco.MjModel, angles: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for name, angle in angles.items():
        data.joint(name).qpos[0] = angle
    mujoco.mj_forward(model, data)
    return data


@settings(max_examples=15, deadline=None)
@given(trees(), st.integers(0, 2**31))
def test_any_tree_has_the_bodies_of_mujocos_importer_to_the_last_digits(text: str, seed: int):
    keep = '<mujoco><compiler fusestatic="false"/></mujoco></robot>'
    theirs = mujoco.MjModel.from_xml_string(text.replace("</robot>", keep))
    ours = mujoco.MjModel.from_xml_string(converted(text, base="fixed", armature={"*": 0.0}).text)
    names = [theirs.joint(j).name for j in range(theirs.njnt)]
    angles = dict(zip(names, np.random.default_rng(seed).uniform(-2, 2, len(names)), strict=True))
    there, here = posed(theirs, angles), posed(ours, angles)

    assert [ours.joint(j).name for j in range(ours.njnt)] == names
    for field in ("jnt_range", "jnt_limited", "dof_damping", "dof_frictionloss", "body_mass"):
        np.testing.assert_allclose(getattr(ours, field), getattr(theirs, field), rtol=1e-12)
    for field in ("xpos", "xmat", "xipos"):
        np.testing.assert_allclose(getattr(here, field), getattr(there, field), atol=1e-12)
    # The inertia as a whole: its principal axes may be in another order.
    np.testing.assert_allclose(here.M, there.M, atol=1e-9)
    geoms = [sorted(map(tuple, np.round(data.geom_xpos, 9) + 0.0)) for data in (here, there)]
    assert geoms[0] == geoms[1]


def test_geoms_of_a_link_fixed_in_the_middle_of_a_limb_are_those_of_the_limb():
    bolt = joint("bolt", "left_thigh", "guard", kind="fixed", xyz="0.1 0 0.05")
    work = converted(with_parts(link("guard", 0.2, BALL), bolt))
    bodies = work.named_bodies()

    assert [geom.get("type") for geom in bodies["left_foot"].findall("geom")] == ["sphere"]
    assert bodies["left_foot"].find("joint") is None
    assert bodies["guard"].find("geom") is None
    (geom,) = bodies["left_thigh"].findall("geom")
    assert np.allclose(np.fromstring(geom.get("pos"), sep=" "), (0.1, 0, 0.05))


def test_a_massless_link_between_two_hinges_is_merged_into_one_body_with_both():
    roll = joint("roll", "a", "cross", axis="1 0 0", xyz="0.1 0.2 0.3")
    pitch = joint("pitch", "cross", "b", xyz="0 0.05 0")
    model = fixed(link("a"), link("cross", 0), link("b"), roll, pitch)
    data = posed(model, {"roll": 0.5, "pitch": -0.3})

    assert [model.body(b).name for b in range(1, model.nbody)] == ["a", "b"]
    expected = np.array([0.1, 0.2 + 0.05 * np.cos(0.5), 0.3 + 0.05 * np.sin(0.5)])
    np.testing.assert_allclose(data.body("b").xpos, expected, atol=1e-12)


def test_links_have_the_mass_of_their_inertial_alone_and_an_inertia_of_a_rigid_body():
    plate = joint("j", "a", "b", kind="fixed")
    assert fixed(link("a"), link("b", 0, BOX), plate).body("b").mass[0] == 0
    odd = 'ixx="0.1" iyy="0.01" izz="0.01"'
    work = converted(WALKER.replace('ixx="0.04" iyy="0.04" izz="0.04"', odd, 1))

    trunk = mujoco.MjModel.from_xml_string(work.text).body("trunk")
    np.testing.assert_allclose(trunk.inertia, 0.04)
    assert any("inertia of trunk" in note for note in work.notes)


def test_visual_geoms_touch_nothing_and_hide_the_collisions_of_their_link():
    visual = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    text = WALKER.replace('<link name="trunk">', f'<link name="trunk">{visual}')
    trunk = converted(text).named_bodies()["trunk"]

    groups = {geom.get("group"): geom.get("contype") for geom in trunk.findall("geom")}
    assert groups == {"2": "0", "3": None}


def servo(kind: str = "revolute", given: dict | None = None, **limits: float) -> list[float]:
    """Returns kp, kd, effort and the ends of the command range of the servo of a joint."""
    model = fixed(
        link("a"), link("b"), joint("knee", "a", "b", kind=kind, **limits), **(given or {})
    )
    _, stiffness, damping = model.actuator_biasprm[0, :3]
    assert model.actuator_forcerange[0, 0] == -model.actuator_forcerange[0, 1]
    return [-stiffness, -damping, model.actuator_forcerange[0, 1], *model.actuator_ctrlrange[0]]


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ({"lower": -1.5, "upper": 0.75, "effort": 20}, [160, 3.2, 20, -1.5, 0.75]),
        ({"lower": -0.1, "upper": 0.1, "effort": 20}, [200, 4, 20, -0.1, 0.1]),
        ({"velocity": 1e6}, [80, 1.6, 10, -1, 1]),
        ({"velocity": 4}, [80, 2.5, 10, -1, 1]),
        ({"velocity": 0}, [80, 8, 10, -1, 1]),
        ({"kind": "continuous"}, [80, 1.6, 10, -math.pi, math.pi]),
        ({"given": {"kp": 5, "kd": {"kn*": 0.5}, "effort": 3}}, [5, 0.5, 3, -1, 1]),
        ({"effort": 0, "given": {"effort": {"knee": 7}}}, [56, 1.12, 7, -1, 1]),
    ],
)
def test_a_servo_follows_from_the_limits_of_its_joint_and_the_settings(
    limits: dict, expected: list[float]
):
    assert servo(**limits) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("given", "limit"),
    [
        ({}, 5.0),
        ({"kp": 400, "kd": 0.1}, 5.0),
        ({"kp": 100, "kd": 0, "damping": 0, "velocity": {"kn*": 3}}, 3.0),
        ({"kp": 400, "kd": 0.1, "velocity": 0}, math.inf),
    ],
)
def test_a_servo_turns_no_faster_than_the_velocity_limit_whatever_its_gains(
    given: dict, limit: float, tmp_path: Path
):
    text = urdf(link("a"), link("b"), joint("knee", "a", "b", kind="continuous", velocity=5))
    model = load_mjcf(written(tmp_path, text), checked_settings({**given, "base": "fixed"})).model
    data, speeds = mujoco.MjData(model), []
    for _ in range(300):
        data.ctrl[0] = math.pi
        mujoco.mj_step(model, data)
        speeds.append(float(data.qvel[0]))
    assert max(speeds) < 1.001 * limit
    assert max(speeds) > (0.8 * limit if math.isfinite(limit) else 10)


@pytest.mark.parametrize(
    ("limits", "given", "expected"),
    [
        ({"effort": 20, "velocity": 5}, {}, 0.04),
        ({"effort": 20, "velocity": 5}, {"velocity": 10}, 0.02),
        ({"effort": 20, "velocity": 5}, {"armature": 0.3}, 0.3),
        ({"effort": 20, "velocity": 5}, {"armature": 0}, 0.0),
        ({"effort": 20, "velocity": 0}, {}, 0.0),
    ],
)
def test_the_rotor_of_a_servo_follows_from_its_limits_or_is_given(
    limits: dict, given: dict, expected: float, tmp_path: Path
):
    text = urdf(link("a"), link("b"), joint("knee", "a", "b", **limits))
    robot = load_mjcf(written(tmp_path, text), checked_settings({**given, "base": "fixed"}))
    assert robot.model.dof_armature[0] == pytest.approx(expected)
    said = [note for note in robot.notes if f"armature {expected:.2g} kg m²" in note]
    assert bool(said) == (expected > 0)


def test_a_velocity_limit_of_nearly_nothing_is_refused(tmp_path: Path):
    text = urdf(link("a"), link("b"), joint("knee", "a", "b", velocity=1e-200))
    with pytest.raises(InputError, match=r"walker\.urdf: .*'knee'.*velocity"):
        load_mjcf(written(tmp_path, text, 'base = "fixed"'))


def test_what_no_robot_needs_is_left_out_with_a_note():
    odom = link("odom", 0) + joint("float", "odom", "trunk", kind="floating")
    tail = link("tail") + joint("tail", "trunk", "tail", lower=0, upper=0)
    gazebo = '<gazebo><plugin filename="evil.so"/></gazebo><mujoco><compiler meshdir="/"/></mujoco>'
    text = with_parts(odom, gazebo).replace("<link ", '<link file="x" ')
    text = text.replace(BALL, BALL + BALL.replace("0.03", "0.0"))
    text = text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><axis xyz="1 0 0"/>')
    work = converted(text)

    assert work.text == converted(WALKER).text
    notes = "; ".join(work.notes)
    assert "1 <gazebo>, 1 <mujoco>" in notes
    assert "the link odom and the joint float are left out" in notes
    assert "2 shapes of size 0 are left out" in notes
    assert "tail has a range of 0 to 0 rad, and is fixed" in "".join(
        converted(with_parts(tail)).notes
    )


XACRO = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="m"/></robot>'
HINGE = joint("j", "a", "b")
CHAIN = [f"l{number}" for number in range(MAX_LINK_DEPTH + 1)]
REFUSED = {
    "xacro": (XACRO, r"xacro robot\.urdf\.xacro > robot\.urdf"),
    "xacro value": (urdf('<link name="${prefix}_a"/>'), r"xacro robot\.urdf\.xacro"),
    "no link": (urdf(), "no <link>"),
    "same links": (urdf(link("a"), link("a")), "a different name for each <link>"),
    "same joints": (urdf(*map(link, "abc"), HINGE, joint("j", "a", "c")), "each <joint>"),
    "no child": (urdf(link("a"), HINGE), "'b', which the URDF does not have"),
    "two parents": (urdf(*map(link, "ab"), HINGE, joint("k", "a", "b")), "has two parents"),
    "two roots": (urdf(*map(link, "ab")), "'a', 'b'"),
    "circle": (urdf(*map(link, "ab"), HINGE, joint("k", "b", "a")), "circle"),
    "circle beside the root": (
        urdf(*map(link, "abc"), joint("i", "b", "c"), joint("k", "c", "b")),
        "circle",
    ),
    "chain": (
        urdf(*map(link, CHAIN), *(joint(b, a, b) for a, b in pairwise(CHAIN))),
        "links in one chain",
    ),
    "prismatic": (urdf(*map(link, "ab"), joint("j", "a", "b", kind="prismatic")), "fix it with"),
    "floating": (urdf(*map(link, "ab"), joint("j", "a", "b", kind="floating")), "only the root"),
    "other type": (urdf(*map(link, "ab"), joint("j", "a", "b", kind="ball")), "revolute, cont"),
    "no range": (WALKER.replace('lower="-1.0"', 'lower="2"'), "lower below upper"),
    "no number": (WALKER.replace('lower="-1.0"', 'lower="x"'), "1 number in lower.*'x'"),
    "not finite": (WALKER.replace('xyz="0 0.1 0"', 'xyz="nan 0 0"'), "3 numbers in xyz"),
    "huge": (WALKER.replace('mass value="4.0"', 'mass value="1e300"'), "1 number in value"),
    "negative mass": (WALKER.replace('mass value="0.5"', 'mass value="-1"'), "at least 0"),
    "no effort": (WALKER.replace("effort", "force"), "'left_hip' has no effort.*effort = "),
    "mimics nothing": (WALKER.replace("</joint>", '<mimic joint="z"/></joint>', 1), "mimics 'z'"),
    "no collision": (WALKER.replace("collision", "visual"), "no link has a <collision>"),
    "no motors": (WALKER.replace('type="revolute"', 'type="fixed"'), "no actuators"),
    "moves without mass": (urdf(link("a", 0, BALL), link("b"), HINGE), "mass and moments above"),
    "document type": ('<!DOCTYPE r [<!ENTITY a "aa">]><robot name="&a;"/>', "<!DOCTYPE>"),
    "deep": ("<robot>" + "<link>" * 5000 + "</link>" * 5000 + "</robot>", "within each other"),
    "cut off": (WALKER[:-20], "no XML"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_an_unusable_urdf_is_refused_in_one_sentence(what: str, tmp_path: Path):
    text, sentence = REFUSED[what]
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=sentence) as refusal:
        load_mjcf(path, checked_settings({}))

    assert str(refusal.value).startswith(str(path))
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 600


def package(folder: Path) -> Path:
    """Writes a ROS package with a mesh, and returns the folder of its URDF."""
    home = folder / "walker_description" / "urdf"
    home.mkdir(parents=True)
    (home.parent / "meshes").mkdir()
    (home.parent / "meshes" / "leg.obj").write_text(CUBE)
    return home


def meshed(uri: str, home: Path, assets: str = "") -> Work:
    text = urdf(link("a", 1, MESH.format("collision", uri)), link("b"), HINGE)
    return read_urdf(parse_xml(text), robot_folder(home, assets), checked_settings({}))


@pytest.mark.parametrize(
    "uri",
    [
        "package://walker_description/meshes/leg.obj",
        "model://walker_description/meshes/leg.dae",
        "..\\meshes\\leg.obj",
        "file://{home}/../meshes/leg.obj",
    ],
)
def test_a_mesh_of_a_ros_package_is_read(uri: str, tmp_path: Path):
    home = package(tmp_path)
    other = tmp_path / "elsewhere"
    other.mkdir()

    assert meshed(uri.format(home=home), home).assets == {"leg.obj": CUBE.encode()}
    if "://walker" in uri:
        assert meshed(uri, other, str(tmp_path)).assets == {"leg.obj": CUBE.encode()}


@pytest.mark.parametrize(
    "uri",
    [
        "file:///etc/hostname.obj",
        "../../../secret.obj",
        "package://x/%2e%2e/%2e%2e/secret.obj",
        "leg&#9;.obj",
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
    with pytest.raises(InputError, match="--set assets=DIR") as refusal:
        meshed(uri, home)

    assert len(str(refusal.value)) < 500


def test_each_file_is_read_once_and_visuals_without_one_are_left_out_with_a_note():
    names = ("left/leg.obj", "right/leg.obj", "left/leg.obj", "gone.stl", "b.dae", "c.dae")
    shapes = "".join(MESH.format("visual", name) for name in names)
    files = {"left/leg.obj": CUBE, "right/leg.obj": CUBE + "\n", "b.dae": "<COLLADA/>"}
    work = converted(WALKER.replace(BOX, BOX + shapes), files)

    assert [mesh.get("file") for mesh in work.root.iter("mesh")] == ["leg.obj", "leg_2.obj"]
    assert set(work.assets) == {"leg.obj", "leg_2.obj"}
    assert len([g for g in work.root.iter("geom") if g.get("mesh")]) == 3
    assert any("1 visual meshes" in note and "gone.stl" in note for note in work.notes)
    assert any("2 visual meshes" in note and ".dae" in note for note in work.notes)


def test_a_urdf_gives_a_robot_with_touch_sensors_on_its_feet_that_stands(tmp_path: Path):
    robot = load_mjcf(written(tmp_path, toml='pose = {"*_hip" = 0.25, "*_knee" = -0.5}'))
    data = mujoco.MjData(robot.model)
    data.ctrl[:] = [0.25, -0.5, 0.25, -0.5]
    mujoco.mj_step(robot.model, data, 100)

    assert (robot.name, robot.root) == ("walker", "trunk")
    assert robot.anatomy.hinges == ("left_hip", "left_knee", "right_hip", "right_knee")
    assert robot.anatomy.motors == robot.anatomy.hinges
    touch = [sensor.body for sensor in robot.anatomy.sensors if sensor.kind == "touch"]
    assert touch == ["left_foot", "right_foot"]
    assert robot.standing_height == pytest.approx(0.4 * np.cos(0.25) + 0.03)
    assert np.abs(data.qvel).max() < 5
    assert robot.has_unknown_ground
    assert not load_mjcf(written(tmp_path, toml='base = "fixed"')).has_unknown_ground


def test_what_friction_holds_slides_in_no_direction(tmp_path: Path):
    arm = joint("shoulder", "trunk", "arm", xyz="0 0 0.1")
    model = load_mjcf(written(tmp_path, urdf(link("trunk", 1, BOX), link("arm", 0.1), arm))).model
    slope = math.atan(0.8)  # of a friction coefficient of 1, along the diagonal of the box
    down = [math.sin(slope) / math.sqrt(2)] * 2 + [-math.cos(slope)]
    model.opt.gravity[:] = 9.81 * np.array(down)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)

    assert np.linalg.norm(data.qpos[:2]) < 0.05


def test_a_base_on_the_link_world_is_fixed_unless_the_user_frees_it(tmp_path: Path):
    mount = joint("mount", "world", "trunk", kind="fixed", xyz="0 0 1.5")
    text = with_parts(link("world", 0), mount)
    stand = load_mjcf(written(tmp_path, toml='base = "fixed"\nbase_height = 0.9'))
    on_world = load_mjcf(written(tmp_path, text))
    free = load_mjcf(written(tmp_path, text, 'base = "free"'))

    assert stand.model.nv == on_world.model.nv == free.model.nv - 6 == 4
    assert (stand.standing_height, on_world.standing_height) == (0.9, 1.5)


def test_the_initial_pose_holds_for_coupled_joints_too(tmp_path: Path):
    mimic = '<mimic joint="left_hip" offset="0.3"/>'
    wing = link("wing", 0.1) + joint("flap", "trunk", "wing", lower=-3, upper=3, more=mimic)
    toml = 'pose = {left_hip = 0.5}\nbase = "fixed"'
    robot = load_mjcf(written(tmp_path, with_parts(wing), toml))

    assert robot.model.joint("flap").qpos0[0] == pytest.approx(0.8)
    with pytest.raises(InputError, match="outside its range of -2"):
        load_mjcf(written(tmp_path, WALKER, "pose = {left_knee = 3}"))


@pytest.mark.process
def test_every_command_with_a_robot_takes_a_urdf(tmp_path: Path):
    before = written(tmp_path, toml='pose = {"*_hip" = 0.25}\nreach = 0.3').read_bytes()
    robot = ("--robot", "walker.urdf")
    done = [
        selfmodel("robots", "walker.urdf", "--json", cwd=tmp_path),
        selfmodel("trial", "walker.urdf", "--steps", "60", "--out", "t.mcap", cwd=tmp_path),
        selfmodel("replay", "t.mcap", *robot, "--json", cwd=tmp_path),
        selfmodel("calibrate", "t.mcap", *robot, "--out", "c.xml", cwd=tmp_path),
    ]

    assert [one.returncode for one in done] == [0] * len(done), [one.stderr for one in done]
    assert any("position servos" in note for note in json.loads(done[0].stdout)["notes"])
    assert json.loads(done[2].stdout)["rms"] is not None
    assert (tmp_path / "walker.urdf").read_bytes() == before
