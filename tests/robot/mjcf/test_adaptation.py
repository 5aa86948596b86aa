"""Tests of the adapted MJCF: it moves as the user's file, with names, ground and sensors."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.robot.actuators import command_ranges
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import MjcfSettings, parse_setting, read_settings
from tests.helpers.exactness import remove_warm_start
from tests.robot.mjcf.awkward import GROUND, LEGS, MOTORS, TORSO, mjcf
from tests.robot.mjcf.motion import moved, theirs, written
from tests.robot.mjcf.samples import SAMPLES


@pytest.mark.parametrize("name", SAMPLES)
def test_a_robot_moves_as_its_file_says(name: str):
    model, robot = theirs(SAMPLES[name]), load_mjcf(SAMPLES[name])

    if not model.nkey:
        remove_warm_start(model)
        before, after = (moved(m, m.qpos0) for m in (model, robot.model))
        if "cheetah" in name:  # its masses are scaled to a sum, which is written out
            assert np.allclose(before.qpos, after.qpos, atol=1e-6)
        else:
            assert np.array_equal(before.qpos, after.qpos)
    assert robot.anatomy.joints
    assert {s.hinge for s in robot.anatomy.sensors if s.kind == "angle"} >= {
        hinge
        for joint in robot.anatomy.joints
        for hinge in joint.hinges
        if any(motor in robot.anatomy.motors for motor in joint.motors) and len(joint.hinges) == 1
    }


@pytest.mark.parametrize("name", list(SAMPLES)[::4])
def test_an_adapted_mjcf_stays_the_same_when_adapted_again(name: str, tmp_path: Path):
    first = load_mjcf(SAMPLES[name])
    again = load_mjcf(written(tmp_path, first.mjcf))

    assert again.anatomy == first.anatomy
    one, other = (moved(robot.model, robot.model.qpos0) for robot in (first, again))
    assert np.array_equal(one.qpos, other.qpos)


@pytest.mark.parametrize(("forward", "axis"), [("x", 0), ("y", 1), ("-x", 0), ("-y", 1)])
def test_forward_is_the_direction_in_the_settings(forward: str, axis: int):
    path = SAMPLES["gymnasium ant"]
    went = moved(theirs(path), theirs(path).qpos0).qpos[axis] * (-1 if "-" in forward else 1)
    robot = load_mjcf(path, MjcfSettings(forward=forward))

    assert moved(robot.model, robot.model.qpos0).qpos[0] == pytest.approx(went, abs=1e-4)


STEP = '<geom type="box" size="1 1 .1" pos="3 0 0"/>'
SLOPE = '<body euler="0 3 0"><geom type="plane" size="0 0 1"/></body>'


@pytest.mark.parametrize("steps", [STEP, f"<body>{STEP}</body>", SLOPE])
def test_uneven_ground_is_not_turned_under_a_robot(steps: str, tmp_path: Path):
    with pytest.raises(InputError, match="not the same from all sides"):
        load_mjcf(written(tmp_path, mjcf(world=GROUND + steps)), MjcfSettings(forward="y"))


def test_ground_is_added_at_the_lowest_point_of_the_robot(tmp_path: Path):
    robot = load_mjcf(written(tmp_path, mjcf(world="")))
    data = mujoco.MjData(robot.model)
    mujoco.mj_kinematics(robot.model, data)
    floor = robot.model.geom("ground").id
    gaps = [
        mujoco.mj_geomDistance(robot.model, data, floor, geom, 10, None)
        for geom in range(robot.model.ngeom)
        if geom != floor
    ]

    assert min(gaps) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("swims", ['<flag contact="disable"/>', ""])
def test_a_swimmer_gets_no_ground(swims: str, tmp_path: Path):
    option = f'<option density="1000" viscosity=".1">{swims}</option>'
    text = mjcf(world="", more=option)

    assert not np.any(load_mjcf(written(tmp_path, text)).model.geom_bodyid == 0)


def bodies_in_contact(model: mujoco.MjModel, data: mujoco.MjData) -> set[str]:
    found, force = set(), np.empty(6)
    for number, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, number, force)
        if force[0] > 0:
            found |= {model.body(model.geom_bodyid[geom]).name for geom in contact.geom}
    return found


@pytest.mark.parametrize("name", ["gymnasium ant", "dm_control walker"])
def test_a_touch_sensor_reads_1_while_its_limb_is_in_contact(name: str):
    robot = load_mjcf(SAMPLES[name])
    model, touched = robot.model, set()
    data = mujoco.MjData(model)
    for step in range(250):
        data.ctrl = 0.5 * np.sin(0.2 * step + np.arange(model.nu))
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        pushed = bodies_in_contact(model, data)
        for sensor in robot.anatomy.sensors:
            if sensor.kind == "touch" and sensor.name.endswith(f"{sensor.body}_touch"):
                felt = data.sensordata[model.sensor(sensor.name).adr[0]] > 0
                assert felt == (sensor.body in pushed)
                touched |= {sensor.name} if felt else set()

    own = [s for s in robot.anatomy.sensors if s.kind == "touch" and s.name in adapted_names(name)]
    assert touched or not own


def adapted_names(name: str) -> set[str]:
    """Returns the names of the sensors that the adaptation has added."""
    model = theirs(SAMPLES[name])
    own = {model.sensor(s).name for s in range(model.nsensor)}
    return {s.name for s in load_mjcf(SAMPLES[name]).anatomy.sensors} - own


def test_unnamed_parts_get_the_names_of_their_neighbours(tmp_path: Path):
    anatomy = load_mjcf(SAMPLES["gymnasium ant"]).anatomy

    assert [joint.name for joint in anatomy.joints][:2] == ["hip_1", "ankle_1"]
    assert anatomy.motors[:2] == ("hip_4", "ankle_4")
    assert anatomy.joint("ankle_1").bodies == {"ankle_1"}
    assert anatomy.sensor("ankle_1_touch").body == "ankle_1"
    bare = mjcf().replace('name="left_hip"', "").replace('joint="left_hip"', 'joint="right_hip"')
    assert load_mjcf(written(tmp_path, bare)).anatomy.hinges == ("left", "right_hip")


def test_special_characters_are_replaced_in_names_and_references(tmp_path: Path):
    odd = mjcf(
        motors=MOTORS,
        more='<contact><exclude body1="torso" body2="left"/></contact>'
        '<sensor><framepos objtype="body" objname="left"/><contact subtree1="left"/></sensor>',
    ).replace("left", "le+ft")
    robot = load_mjcf(written(tmp_path, odd))

    assert robot.anatomy.hinges == ("le_ft_hip", "right_hip")
    assert robot.model.nexclude == 1
    assert any("le+ft_hip" in note for note in robot.notes)


def test_the_settings_choose_the_sensors(tmp_path: Path):
    path = written(tmp_path, mjcf())
    robot = load_mjcf(path, MjcfSettings(touch=("left",), angle=()))

    assert [sensor.name for sensor in robot.anatomy.sensors] == ["left_touch"]
    with pytest.raises(InputError, match="'lft': did you mean left"):
        load_mjcf(path, MjcfSettings(touch=("lft",)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("forwards = 'x'", "unknown setting 'forwards': did you mean forward"),
        ("forward = 'z'", "forward needs one of x, y, -x, -y, got 'z'"),
        ("forward = ['-x']", "got ['-x']"),
        (f"control_timestep = 1{'0' * 400}", "an integer has more than 64 bits"),
        (f"control_timestep = 1{'0' * 5000}", "in TOML"),
        (f"touch = {'[' * 3000}", "in TOML"),
        ("control_timestep = -1", "from above 0 to 10 s, got -1"),
        ("control_timestep = true", "got True"),
        ("touch = 'left'", "needs a list of names"),
        ("ctrlrange = [1, -1]", "lower end first"),
        ("keyframe = 3", "name of a keyframe"),
        ("[joints]", "another name"),
        ("forward", "in TOML"),
    ],
)
def test_an_invalid_setting_is_refused(text: str, said: str, tmp_path: Path):
    path = written(tmp_path, mjcf())
    path.with_suffix(".toml").write_text(text, encoding="utf-8")

    with pytest.raises(InputError, match=r"robot\.toml") as refusal:
        load_mjcf(path)

    assert said in str(refusal.value)


def test_the_settings_file_is_read_and_options_override_it(tmp_path: Path):
    path = written(tmp_path, mjcf(motors=MOTORS.replace('ctrlrange="-1 1"', "")))
    beside = 'forward = "y"\ncontrol_timestep = 0.02\nctrlrange = [-2, 2]\n'
    path.with_suffix(".toml").write_text(beside, encoding="utf-8")

    robot = load_mjcf(path)

    assert robot.control_timestep == 0.02
    assert robot.model.actuator_ctrlrange.tolist() == [[-2, 2], [-2, 2]]
    extra = parse_setting("forward=-x") | parse_setting("touch=['left']")
    assert read_settings(path, extra).forward == "-x"
    assert read_settings(path, extra).touch == ("left",)
    assert read_settings(path).forward == "y"


def test_a_motor_with_another_kind_of_range_keeps_it(tmp_path: Path):
    motors = '<motor joint="left_hip"/><position joint="right_hip" kp="5"/>'
    path = written(tmp_path, mjcf(motors=motors))

    model = load_mjcf(path, MjcfSettings(ctrlrange=(-1, 1))).model

    assert model.actuator_ctrllimited.tolist() == [1, 0]
    (_, left), (_, right) = command_ranges(model)
    assert (left, right) == (1, pytest.approx(np.radians(40)))


def test_a_control_step_is_a_multiple_of_the_physics_step(tmp_path: Path):
    path = written(tmp_path, mjcf(more='<option timestep="0.003"/>'))

    assert load_mjcf(path).control_timestep == pytest.approx(0.012)
    with pytest.raises(InputError, match=r"multiple of the physics time step 0\.003"):
        load_mjcf(path, MjcfSettings(control_timestep=0.01))


@pytest.mark.parametrize("inertia", ["true", "false", "auto"])
def test_expanded_masses_are_those_of_the_model(inertia: str, tmp_path: Path):
    given = '<inertial pos="0 0 0" mass="2" diaginertia=".01 .01 .01"/>'
    limbs = LEGS.replace('<joint name="left', f'{given}<joint name="left')
    limbs = limbs.replace('<joint name="right', f'{given}<joint name="right')
    # Bodies that may be without mass: they cannot move by themselves.
    plate = '<body><geom size=".1" pos="0 .2 0"/></body>'
    hollow = '<body><inertial pos="0 0 0" mass="0"/><geom size=".1" pos="0 .2 0"/></body>'
    ghost = f'<body>{given}<geom size=".1" mass="0"/></body>'
    text = mjcf(
        torso=given + TORSO + plate + hollow + ghost,
        legs=limbs,
        more=f'<compiler settotalmass="7" inertiafromgeom="{inertia}"/>',
    )
    path = written(tmp_path, text)

    model, robot = theirs(path), load_mjcf(path)

    assert robot.model.body_mass == pytest.approx(model.body_mass, rel=1e-9)
    assert robot.model.body_inertia == pytest.approx(model.body_inertia, rel=1e-9)
