"""What is suggested is right where it is sure, and marked where it is not."""

from pathlib import Path

import pytest

from selfmodel.logs.recordings.mapping.likeness import likeness, matched
from selfmodel.logs.recordings.mapping.mapping_file import parse_mapping
from selfmodel.logs.recordings.mapping.suggest import suggest
from selfmodel.robot.robot import Robot
from tests.logs.recordings.conftest import imported, recorded
from tests.logs.recordings.rosbag.bags import T0, array, joint_state, write_bag

LEGS = ("front_left", "front_right", "back_left", "back_right")
MODEL = [f"{leg}_{part}" for leg in LEGS for part in ("shoulder", "knee")]


@pytest.mark.parametrize(
    "legs", [("FL", "FR", "RL", "RR"), ("LF", "RF", "LH", "RH"), ("fl", "fr", "hl", "hr")]
)
@pytest.mark.parametrize(
    ("told", "parts"),
    [
        ("{}_{}_joint", ("thigh", "calf")),
        ("{}_{}", ("HFE", "KFE")),
        ("joint/{}/{}", ("shoulder", "knee")),
        ("{}{}", ("Shoulder", "Knee")),
    ],
)
def test_the_usual_names_are_known(told: str, parts: tuple, legs: tuple):
    names = [told.format(leg, part) for leg in legs for part in parts]
    found = matched(MODEL, names[::-1])
    assert [found[name].name for name in MODEL] == names
    assert all(guess.sure for guess in found.values())


def test_sides_are_never_confused():
    assert likeness("front_left_knee", "FR_knee") == 0
    assert likeness("front_left_knee", "RL_knee") == 0
    assert "front_left_knee" not in matched(["front_left_knee"], ["FR_knee", "arm"])


def test_a_name_of_a_million_letters_is_not_compared():
    assert matched(["front_left_knee"], ["front_left_knee" * 10**5]) == {}


def test_a_name_that_might_be_either_is_a_guess():
    found = matched(["left_hip_x", "left_hip_y"], ["L_hip"])
    assert [guess.sure for guess in found.values()] == [False]


def test_commands_without_names_get_an_order_to_check(biped: Robot, bag: Path):
    text = suggest(bag, biped, "biped.xml", with_timestep=True)
    assert 'order = ["LHX", "LHY", "RHX", "RHY"]  # CHECK: the bag has no names' in text
    assert "control_timestep = 0.01" in text
    assert "# No topic is similar to right_touch" in text
    assert 'left_hip_x = "LHX"\n' in text
    assert imported(bag, biped, text).behaviour.steps == 99


def test_what_the_bag_lacks_must_be_filled_in(biped: Robot, tmp_path: Path):
    items = [("/joints", T0, joint_state(T0, ["arm"], [0.0])), ("/x", T0, array([0.0]))]
    text = suggest(write_bag(tmp_path / "bag", items), biped, "biped.xml", with_timestep=True)
    assert 'left_hip_x = "?"  # CHANGE: the bag has arm' in text
    assert 'order = ["arm"]  # CHECK' in text
    assert "# No topic has the position of the base" in text


def test_states_and_commands_of_one_type_are_told_apart_by_name(biped: Robot, tmp_path: Path):
    items = [item for item in recorded() if item[0] == "/joint_states"]
    items += [("/joint_cmd", time, message) for _, time, message in items]
    items += [("/arm/joints", T0, joint_state(T0, ["elbow"], [0.0])), ("/lamp_cmd", T0, array([0]))]
    bag = write_bag(tmp_path / "bag", items)
    mapping = parse_mapping(suggest(bag, biped, "b.xml", with_timestep=True), "m")
    assert (mapping.joints.topic, mapping.commands.topic) == ("/joint_states", "/joint_cmd")


def test_names_that_hold_anything_stay_names(biped: Robot, tmp_path: Path):
    names = ['LHX\n"', "left\x1b[31m_hip_y\\", "right hip é x", "RHY"]
    items = [("/joints", T0, joint_state(T0, names, [0.0] * 4))]
    items.append(("/x\n\x7f", T0, joint_state(T0, names[:1], [0.0])))
    text = suggest(write_bag(tmp_path / "bag", items), biped, "b.xml", with_timestep=True)
    assert all(char.isprintable() or char == "\n" for char in text)
    for number in range(text.count('"?"')):
        text = text.replace('"?"', f'"{number}"', 1)
    told = {link.name for link in parse_mapping(text, "m").joints.links.values()}
    assert {names[1], names[2], names[3]} <= told


def test_a_hinge_for_which_no_joint_is_left_has_no_encoder(biped: Robot, tmp_path: Path):
    items = [item for item in recorded() if item[0] != "/joint_states"]
    for k in range(200):
        stamp = T0 + k * 5_000_000
        items.append(("/joint_states", stamp, joint_state(stamp, ["LHY", "RHX", "RHY"], [0.0] * 3)))
    bag = write_bag(tmp_path / "bag", items)

    text = suggest(bag, biped, "biped.xml", with_timestep=True)
    assert 'left_hip_x = "none"  # CHECK: no encoder: the bag has no other joint' in text
    assert 'left_hip_x = "?"  # CHANGE' in text  # a motor has a command
