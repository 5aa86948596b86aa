"""Every mistake in a mapping is told with its line, and with what could have been meant."""

import re
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.logs.recordings.mapping import Link
from selfmodel.logs.recordings.mapping_file import parse_mapping, read_mapping
from selfmodel.robot.robot import Robot
from tests.logs.recordings.bags import T0, joint_state, write_bag
from tests.logs.recordings.conftest import JOINTS, MAPPING, imported, recorded

LINES = MAPPING.splitlines()


def at(text: str) -> int:
    """The line of the mapping on which a text first stands."""
    return next(n for n, line in enumerate(LINES, start=1) if text in line)


MISTAKES = [
    ('topic = "/joint_states"', 'topic = "/joint_state"', "did you mean /joint_states"),
    ('topic = "/odom"', 'topic = "/odometry"', "topic of the bag '/odometry': did you mean /odom"),
    ('topic = "/odom"', 'topic = "/imu"', "expected a topic of nav_msgs/msg/Odometry or .* /odom"),
    ('topic = "/left_foot"', 'topic = "/joint_states"', "for touch.left_touch, got /joint_states"),
    ('left_hip_x = "LHX"', 'left_hip_x = "LHZ"', "joint on /joint_states 'LHZ': did you mean LH"),
    ('left_hip_x = "LHX"', 'left_hop_x = "LHX"', "unknown hinge .* did you mean left_hip_x"),
    ('right_hip_x = "RHX"', 'right_hip_x = "LHX"', "LHX is listed twice, for left_hip_x and for"),
    ('left_hip_x = "LHX"', "left_hip_x = 3", 'must be "a name in the recording" or'),
    ("sign = -1", "sign = -2", "sign must be 1 or -1, got -2"),
    ("sign = -1", "sing = -1", "unknown key of .* 'sing': did you mean sign"),
    ("offset = 0.1", "offset = nan", "offset must be a number, got nan"),
    ('unit = "rad"', 'unit = "radians"', "unknown unit 'radians': did you mean rad"),
    ("threshold = 5.0", 'threshold = "5"', "threshold must be a number, got '5'"),
    ("threshold = 5.0", "index = 0", "index is for topics of std_msgs/msg/Float64MultiArray"),
    ("threshold = 5.0", 'unit = "lb"', "unknown unit 'lb'"),
    ("[touch.left_touch]", "[touch.left_tuch]", "touch sensor .* did you mean left_touch"),
    ('robot = "biped.xml"', "robot = 3", "robot must be a text in quotes, got 3"),
    ('robot = "biped.xml"', 'clock = "log"', "robot, and has none"),
    (
        "control_timestep = 0.01",
        "control_timestep = 0",
        "must be a number > 0.0, got 0",
    ),
    ("control_timestep = 0.01", "control_timestp = 0.01", "did you mean control_timestep"),
    ("control_timestep = 0.01", 'clock = "sim"', "unknown clock 'sim': .* header, log"),
    ("control_timestep = 0.01", 'stage = "befor"', "unknown stage 'befor': did you mean before"),
    ("control_timestep = 0.01", "start = -1", "start must be a number >= 0.0, got -1"),
    ("control_timestep = 0.01", "duration = true", "duration must be a number, got True"),
    ('order = ["RHY", "RHX", "LHY", "LHX"]', 'order = ["RHY"]', "RHX.*|name in order"),
    ('"LHY", "LHX"]', '"LHY", "RHX"]', "RHX is listed twice in order"),
    ('"LHY", "LHX"]', '"LHY", "LHX", "X"]', "must name the 4 numbers .* got 5 names"),
    ('topic = "/odom"', "topic = /odom", "expected TOML"),
    ('topic = "/odom"', 'topic = "/odom"\nframe = "odom"', "unknown frame 'odom'"),
]


@pytest.mark.parametrize(("right", "wrong", "match"), MISTAKES, ids=[m[1] for m in MISTAKES])
def test_a_mistake_is_told_with_its_line(
    right: str, wrong: str, match: str, biped: Robot, bag: Path
):
    line = at(right)
    if "frame" in wrong:
        line += 1
    if 'RHY"]' in wrong:
        line = at("[commands.names]") + 1
    if "clock" in wrong and "robot" in right:
        line = 1
    with pytest.raises(InputError, match=rf"^MAP\.toml:{line}: .*{match}"):
        imported(bag, biped, MAPPING.replace(right, wrong, 1))


def test_a_hinge_listed_twice_is_told_with_its_line(biped: Robot, bag: Path):
    text = MAPPING.replace('right_hip_x = "RHX"', 'left_hip_x = "RHX"', 1)
    line = at('right_hip_x = "RHX"')
    with pytest.raises(InputError, match=rf"MAP\.toml:{line}: left_hip_x is listed twice"):
        imported(bag, biped, text)


def test_a_hinge_left_out_is_told(biped: Robot, bag: Path):
    text = MAPPING.replace('right_hip_x = "RHX"\n', "", 1)
    match = rf"MAP\.toml:{at('[joints.names]')}: .* every hinge .* lacks right_hip_x"
    with pytest.raises(InputError, match=match):
        imported(bag, biped, text)


def test_a_table_left_out_is_told():
    with pytest.raises(InputError, match="the mapping needs commands, and has none"):
        parse_mapping(MAPPING[: MAPPING.index("[commands]")], "MAP.toml")


def test_numbers_without_names_need_an_order(biped: Robot, bag: Path):
    text = MAPPING.replace('order = ["RHY", "RHX", "LHY", "LHX"]\n', "")
    match = rf"MAP\.toml:{at('[commands]')}: /commands has numbers without names .* add order"
    with pytest.raises(InputError, match=match):
        imported(bag, biped, text)


def test_a_topic_without_messages_or_numbers_is_told(biped: Robot, tmp_path: Path):
    items = [item for item in recorded() if item[0] != "/joint_states"]
    items.append(("/joint_states", T0, joint_state(T0, JOINTS, [])))
    with pytest.raises(InputError, match="has no number for left_hip_x"):
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
    wrong = text.replace('"left hip" = "l"', '"left hip" = 1')
    with pytest.raises(InputError, match=r'^M:4: left hip must be "a name'):
        parse_mapping(wrong, "M")


def test_what_was_not_filled_in_is_told_as_such():
    text = (
        'robot = "r"\n[joints]\ntopic = "/j"\nunit = "rad"\n[joints.names]\n'
        'hip = "l"\nknee = "?"\nankle = "?"\n[commands]\ntopic = "/c"\nunit = "raw"\nnames = {}'
    )
    with pytest.raises(InputError, match=r"M:7: knee is still '\?': fill in its name"):
        parse_mapping(text, "M")


def test_a_file_that_is_no_mapping_is_told(tmp_path: Path):
    with pytest.raises(InputError, match="expected a mapping that can be read"):
        read_mapping(tmp_path / "none.toml")
    path = tmp_path / "map.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="expected TOML in UTF-8"):
        read_mapping(path)
    path.write_text("")
    with pytest.raises(InputError, match=r"map\.toml:1: the mapping needs robot"):
        read_mapping(path)


def test_no_misprint_crashes(biped: Robot, bag: Path):
    rng = np.random.default_rng(0)
    for _ in range(150):
        spoilt = list(MAPPING)
        for _ in range(int(rng.integers(1, 4))):
            spoilt[rng.integers(len(spoilt))] = chr(rng.integers(32, 127))
        with suppress(InputError):
            assert imported(bag, biped, "".join(spoilt)).behaviour.steps >= 2


def test_the_mapping_in_the_guide_is_one():
    guide = (Path(__file__).parents[3] / "docs" / "how-to" / "import-a-recording.md").read_text(
        encoding="utf-8"
    )
    text = guide.partition("```toml\n")[2].partition("```")[0]
    mapping = parse_mapping(text, "guide")
    assert mapping.trial.joints.links["front_left_knee"] == Link("FL_knee", -1, 0.1)
    assert mapping.trial.touch["front_left_touch"].threshold == 5


@pytest.mark.parametrize(
    ("value", "match"),
    [
        ("9" * 5000, "an integer has more than 64 bits"),
        ("0x" + "f" * 5000, "an integer has more than 64 bits"),
        ("1e999", "must be a number, got inf"),
        ("1979-05-27", "must be a number, got datetime"),
        ("[" * 100_000, "expected TOML"),
        ("{a=" * 100_000, "expected TOML"),
        ("[" * 50 + "]" * 50, r"must be a number, got \[\[\["),
        ('"' + "x" * 10**5 + '"', r"must be a number, got 'x+\.\.\."),
        ("{" + ".".join("a" * 20) + " = 1}", "more than 16 keys are joined by dots"),
    ],
    ids=lambda text: text[:8],
)
def test_no_value_is_too_strange_for_a_sentence(value: str, match: str):
    text = MAPPING.replace("control_timestep = 0.01", f"control_timestep = {value}")
    with pytest.raises(InputError, match=rf"^MAP\.toml:\d+: .*{match}") as caught:
        parse_mapping(text, "MAP.toml")
    assert len(str(caught.value)) < 1000


def many_names(count: int) -> str:
    lines = "\n".join(f'a{k} = "b{k}"' for k in range(count))
    return MAPPING.replace("[commands.names]", f"[commands.names]\n{lines}")


def long_order(count: int) -> str:
    return MAPPING.replace('order = ["RHY"', f"order = {[f'a{k}' for k in range(count)]}"[:-1])


@pytest.mark.fuzz
@pytest.mark.parametrize("text", [many_names, long_order])
def test_the_time_of_a_mapping_is_linear_in_its_names(text: Callable[[int], str]):
    def seconds(count: int) -> float:
        given = text(count)
        start = time.process_time()
        with suppress(InputError):
            parse_mapping(given, "MAP.toml")
        return time.process_time() - start

    # Four times the names take four times the time; pairs of names, sixteen times.
    assert min(seconds(40_000) for _ in range(3)) < 8 * min(seconds(10_000) for _ in range(3))


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("[commands.names]\nleft_hip_x", "[commands.names]\nleft_hip_x", "must have a command"),
        ("[joints.names]", "[joints.names]", "the name of one joint or more, got 'none' for all"),
    ],
    ids=["motor", "all hinges"],
)
def test_only_some_hinges_may_have_no_encoder(old: str, new: str, reason: str):
    before, after = MAPPING.split(old)
    names = after.split("\n\n")[0]
    lost = re.sub(r"= (\"\w+\"|\{.*\})", '= "none"', names)
    with pytest.raises(InputError, match=reason):
        parse_mapping(before + new + after.replace(names, lost, 1), "MAP.toml")
