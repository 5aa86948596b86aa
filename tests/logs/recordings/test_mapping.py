"""Each mistake in a mapping is refused with its line, its key, and what could have been meant."""

from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.mapping import Link
from selfmodel.logs.recordings.mapping_file import parse_mapping, read_mapping
from selfmodel.robot.robot import Robot
from tests.logs.recordings.bags import T0, joint_state, write_bag
from tests.logs.recordings.conftest import JOINTS, MAPPING, imported, recorded

ORDER = 'order = ["RHY", "RHX", "LHY", "LHX"]'


def line_of(text: str, mapping: str = MAPPING) -> int:
    """The line of a mapping on which a text first stands."""
    return mapping[: mapping.index(text)].count("\n") + 1


@pytest.mark.parametrize(
    ("right", "wrong", "named"),
    [
        ('topic = "/joint_states"', 'topic = "/joint_state"', "did you mean /joint_states"),
        ('topic = "/odom"', 'topic = "/imu"', "nav_msgs/msg/Odometry or .* /odom"),
        ('topic = "/left_foot"', 'topic = "/joint_states"', "touch.left_touch, got /joint_states"),
        ('left_hip_x = "LHX"', 'left_hip_x = "LHZ"', "joint on /joint_states 'LHZ': did .* LH"),
        ('left_hip_x = "LHX"', 'left_hop_x = "LHX"', "unknown hinge .* did you mean left_hip_x"),
        ('right_hip_x = "RHX"', 'right_hip_x = "LHX"', "LHX is listed twice, for left_hip_x and"),
        ('right_hip_x = "RHX"', 'left_hip_x = "RHX"', "left_hip_x is listed twice"),
        ('left_hip_x = "LHX"', "left_hip_x = 3", 'left_hip_x must be "a name in the recording" or'),
        ('left_hip_x = "LHX"', 'left_hip_x = "?"', "left_hip_x is still '?'"),
        ("sign = -1", "sign = -2", "sign must be 1 or -1, got -2"),
        ("sign = -1", "sing = -1", "unknown key of .* 'sing': did you mean sign"),
        ("offset = 0.1", "offset = nan", "offset must be a number, got nan"),
        ('unit = "rad"', 'unit = "radians"', "unknown unit 'radians': did you mean rad"),
        ("threshold = 5.0", 'threshold = "5"', "threshold must be a number, got '5'"),
        ("threshold = 5.0", "index = 0", "index is for topics of std_msgs/msg/Float64MultiArray"),
        ("[touch.left_touch]", "[touch.left_tuch]", "touch sensor .* did you mean left_touch"),
        ('robot = "biped.xml"', "robot = 3", "robot must be a text in quotes, got 3"),
        ("control_timestep = 0.01", "control_timestep = 0", "must be a number > 0.0, got 0"),
        ("control_timestep = 0.01", "control_timestp = 0.01", "did you mean control_timestep"),
        ("control_timestep = 0.01", 'stage = "befor"', "unknown stage 'befor': did .* before"),
        ("control_timestep = 0.01", "duration = true", "duration must be a number, got True"),
        ("control_timestep = 0.01", "duration = 1979-05-27", "a number, got datetime"),
        ("control_timestep = 0.01", f"start = {'9' * 5000}", "an integer has more than 64 bits"),
        ("control_timestep = 0.01", f"start = {['x' * 10**5]}", "must be a number, got .*[.][.]"),
        ('"LHY", "LHX"]', '"LHY", "RHX"]', "RHX is listed twice in order"),
        ('"LHY", "LHX"]', '"LHY", "LHX", "X"]', "must name the 4 numbers .* got 5 names"),
        ('topic = "/odom"', "topic = /odom", "expected TOML"),
        ("threshold = 5.0", 'column = "c"', "column is for a table, or a topic .* got /left_foot"),
        ('topic = "/imu"', "orientation=['w','x','y','z']\ntopic='/imu'", "orientation is for a"),
        ('topic = "/odom"', "velocity_frame='world'\ntopic='/odom'", "velocity_frame is for a ta"),
    ],
)
def test_a_mistake_has_its_line(right: str, wrong: str, named: str, biped: Robot, bag: Path):
    text = MAPPING.replace(right, wrong, 1)
    with pytest.raises(InputError, match=rf"^MAP\.toml:{line_of(right)}: .*{named}") as caught:
        imported(bag, biped, text)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    ("left_out", "place", "named"),
    [
        ('robot = "biped.xml"', "control", "the mapping needs robot"),
        ('right_hip_x = "RHX"', "[joints.names]", "every hinge .* lacks right_hip_x"),
        (ORDER, "[commands]", "/commands has numbers without names .* add order"),
        ('topic = "/commands"', "[commands]", r"\[commands\] needs topic"),
        ('topic = "/joint_states"', "[joints]", r"\[joints\] needs topic, .* the mapping \[time\]"),
    ],
)
def test_what_is_left_out_is_named_at_its_table(
    left_out: str, place: str, named: str, biped: Robot, bag: Path
):
    text = MAPPING.replace(f"{left_out}\n", "", 1)
    with pytest.raises(InputError, match=rf"^MAP\.toml:{line_of(place, text)}: .*{named}"):
        imported(bag, biped, text)


@pytest.mark.parametrize("role", ["joints", "commands"])
def test_only_some_hinges_may_have_no_encoder(role: str):
    before, names, after = MAPPING.partition(f"[{role}.names]\n")
    lines = after.split("\n")
    lines[:4] = [f'{line.partition(" ")[0]} = "none"' for line in lines[:4]]
    with pytest.raises(InputError, match=r"MAP\.toml:\d+: .*'none'"):
        parse_mapping(before + names + "\n".join(lines), "MAP.toml")


def test_a_topic_without_numbers_is_named(biped: Robot, tmp_path: Path):
    items = [item for item in recorded() if item[0] != "/joint_states"]
    items.append(("/joint_states", T0, joint_state(T0, JOINTS, [])))
    with pytest.raises(InputError, match="/joint_states has no number for left_hip_x"):
        imported(write_bag(tmp_path / "bag", items), biped)


def test_keys_may_be_dotted_quoted_or_inline():
    text = (
        'robot = "x"\njoints.topic = "/a"\njoints.unit = "rad"\n'
        'joints.names."left hip" = "l"\n[commands]\ntopic = "/c"\n'
        'unit = "rad"\nnames = { a = "l", b = "l" }\n'
    )
    with pytest.raises(InputError, match=r"M:8: l is listed twice, for a and for b"):
        parse_mapping(text, "M")
    mapping = parse_mapping(text.replace(', b = "l"', ""), "M")
    assert mapping.trial.joints.links["left hip"].name == "l"
    with pytest.raises(InputError, match=r"^M:4: left hip must be"):
        parse_mapping(text.replace('"left hip" = "l"', '"left hip" = 1'), "M")


def test_a_file_that_is_no_mapping_is_named(tmp_path: Path):
    path = tmp_path / "map.toml"
    for content in (None, b"\xff\xfe", b""):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(InputError, match=r"map\.toml"):
            read_mapping(path)


def test_the_mappings_in_the_guide_are_read():
    guide = (Path(__file__).parents[3] / "docs/how-to/import-a-recording.md").read_text()
    bag, unitree, table = (part.partition("```")[0] for part in guide.split("```toml\n")[1:4])
    mapping = parse_mapping(bag, "guide").trial
    assert mapping.joints.links["front_left_knee"] == Link("FL_knee", -1, 0.1)
    assert mapping.touch["front_left_touch"].threshold == 5
    places = parse_mapping(unitree, "guide").places
    assert places["joint_velocities", "FL_hip_joint"].columns == ("motor_state[3].dq",)
    assert parse_mapping(table, "guide").trial.time.column == "time"
