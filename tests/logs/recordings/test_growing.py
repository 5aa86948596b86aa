"""A bag that grows has the steps of its import: each once, as soon as it is old enough."""

import shutil
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from itertools import product, repeat
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from selfmodel.errors import InputError
from selfmodel.logs.recordings.growing import FEWEST, LAG, GrowingBag
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.robot.robot import Robot
from selfmodel.trials.trajectory import Sample, Trajectory, collect
from tests.logs.conftest import MJCF
from tests.logs.recordings.bags import (
    ROS,
    T0,
    Item,
    joint_state,
    storage,
    write_bag,
    write_mcap,
)
from tests.logs.recordings.conftest import JOINTS, JOINTS_ONLY, MAPPING, imported, recorded

SAMPLE = Path(__file__).parents[4] / "shared/samples/synthetic_rosbag2_humble_jitter_gap.mcap"
"""A bag that rosbags wrote, with jitter and gaps, which is not in the repository."""

OF_SAMPLE = """\
robot = "biped.xml"
control_timestep = 0.01
[joints]
topic = "/joint_states"
unit = "rad"
[joints.names]
left_hip_x = "LF_HAA"
left_hip_y = "LF_HFE"
right_hip_x = "RF_HAA"
right_hip_y = { name = "RF_HFE", sign = -1, offset = 0.1 }
[commands]
topic = "/joint_group_position_controller/commands"
unit = "rad"
order = ["RF_HAA", "RF_HFE", "LF_HAA", "LF_HFE", "LF_KFE", "RF_KFE"]
[commands.names]
left_hip_x = "LF_HAA"
left_hip_y = "LF_HFE"
right_hip_x = "RF_HAA"
right_hip_y = "RF_HFE"
[base]
topic = "/odom"
[imu]
topic = "/imu/data"
[touch.left_touch]
topic = "/ft/left_foot"
threshold = 5.0
"""


class Growth:
    """A bag that a recorder writes: the steps and notes of it so far, and whether it ended."""

    def __init__(self, path: Path, robot: Robot, mapping: str = MAPPING) -> None:
        self.path, self.notes = path, list[str]()
        self.bag = GrowingBag(path, parse_mapping(mapping, "MAP.toml"), robot, self.notes.append)
        self.steps = list[Sample]()

    def look(self) -> int:
        """Looks for new steps, and returns their number."""
        new = self.bag.new_steps()
        self.steps += new
        return len(new)

    def append(self, data: bytes, pieces: Iterable[int], file: Path | None = None) -> None:
        """Writes a file in pieces of some bytes, with a look after each."""
        begin, sizes = 0, iter(pieces)
        with (file or self.path).open("ab") as opened:
            while begin < len(data):
                begin, old = begin + next(sizes), begin
                opened.write(data[old:begin])
                opened.flush()
                self.look()

    def rows(self, robot: Robot) -> Trajectory:
        """Returns the steps so far."""
        return collect(robot.anatomy.names, self.steps)


@pytest.fixture
def grow(tmp_path: Path, biped: Robot) -> Iterator[Callable[..., Growth]]:
    """Begins to read a file that is still empty, ``grown.mcap``, or another bag."""
    opened = []

    def begin(path: Path | None = None, mapping: str = MAPPING, robot: Robot = biped) -> Growth:
        if path is None:
            path = tmp_path / "grown.mcap"
            path.write_bytes(b"")
        opened.append(Growth(path, robot, mapping))
        return opened[-1]

    yield begin
    for one in opened:
        one.bag.close()


def assert_same(found: Trajectory, expected: Trajectory) -> None:
    """The steps are those of an import, to the bit, as many as there are."""
    assert np.array_equal(found.time, expected.time[: found.steps])
    for signal, values in expected.signals.items():
        np.testing.assert_array_equal(found[signal], values[: found.steps], err_msg=signal)


WRITERS: dict[str, Callable[[Path, list[Item]], object]] = {
    "rosbags": lambda path, items: shutil.copy(
        storage(write_bag(path.with_suffix(""), items)), path
    ),
    "rosbags, messages compressed": lambda path, items: shutil.copy(
        storage(write_bag(path.with_suffix(""), items, "mcap-message")), path
    ),
    "mcap, small chunks": lambda path, items: write_mcap(path, items, chunk_size=5000),
    "mcap, lz4": lambda path, items: write_mcap(path, items, compression=CompressionType.LZ4),
    "mcap, no chunks": lambda path, items: write_mcap(path, items, use_chunking=False),
}


@pytest.mark.parametrize("writer", WRITERS)
def test_a_bag_that_grows_by_any_bytes_has_the_steps_of_its_import(
    writer: str, biped: Robot, tmp_path: Path, grow: Callable[..., Growth]
):
    finished, rng = tmp_path / "finished.mcap", np.random.default_rng(len(writer))
    WRITERS[writer](finished, recorded(2.0))
    grown = grow()
    grown.append(finished.read_bytes(), (int(rng.choice((1, 60, 3000))) for _ in repeat(0)))

    assert_same(grown.rows(biped), imported(finished, biped).trajectory)
    assert len(grown.steps) == grown.bag.steps == imported(finished, biped).trajectory.steps
    assert grown.bag.has_ended
    assert grown.notes == []


@pytest.mark.parametrize(
    "change",
    [
        ("[base]\n", '[base]\nframe = "recorded"\n'),
        ("[joints]\n", "start = 0.3\nduration = 0.9\nleave_out = [[0.1, 0.2]]\n[joints]\n"),
        ("[joints]\n", 'clock = "log"\n[joints]\n'),
        ('[base]\ntopic = "/odom"\n', ""),
    ],
    ids=["frame", "part", "log times", "no odometry"],
)
def test_a_mapping_means_the_same_of_a_bag_that_grows(
    change: tuple[str, str], biped: Robot, tmp_path: Path, grow: Callable[..., Growth]
):
    write_mcap(tmp_path / "finished.mcap", recorded(2.0), use_chunking=False)
    mapping = MAPPING.replace(*change)
    expected = imported(tmp_path / "finished.mcap", biped, mapping).trajectory
    grown = grow(mapping=mapping)
    grown.append((tmp_path / "finished.mcap").read_bytes(), repeat(4001))

    assert_same(grown.rows(biped), expected)
    assert len(grown.steps) == expected.steps
    assert grown.bag.has_ended


@pytest.mark.skipif(not SAMPLE.exists(), reason=f"no {SAMPLE}")
@pytest.mark.parametrize("piece", [3001, 200_000])
def test_jitter_gaps_and_unknown_numbers_are_those_of_the_import(
    piece: int, biped: Robot, grow: Callable[..., Growth]
):
    grown = grow(mapping=OF_SAMPLE)
    grown.append(SAMPLE.read_bytes(), repeat(piece))

    expected = imported(SAMPLE, biped, OF_SAMPLE).trajectory
    assert np.isnan(expected["joint_positions"]).any()
    assert_same(grown.rows(biped), expected)
    assert len(grown.steps) == expected.steps


def test_a_rate_that_falls_is_no_gap_as_in_the_import(
    biped: Robot, tmp_path: Path, grow: Callable[..., Growth]
):
    items = []
    for k in (*range(300), *range(300, 800, 4)):  # 200 Hz, then 50 Hz
        stamp = T0 + k * 5_000_000
        items.append(("/joint_states", stamp, joint_state(stamp, JOINTS, [k / 1000] * 4)))
        items.append(("/commands", stamp, joint_state(stamp, JOINTS, [0.0] * 4)))
    write_mcap(tmp_path / "finished.mcap", items, use_chunking=False)
    grown = grow(mapping=JOINTS_ONLY)
    grown.append((tmp_path / "finished.mcap").read_bytes(), repeat(500))

    expected = imported(tmp_path / "finished.mcap", biped, JOINTS_ONLY).trajectory
    assert np.isfinite(expected["joint_positions"]).all()
    assert_same(grown.rows(biped), expected)


def test_angles_that_go_round_go_on_as_in_the_import(tmp_path: Path, grow: Callable[..., Growth]):
    free = Robot("biped", MJCF.replace(' range="-30 30"', ""), 0.01)
    items = []
    for k in range(1000):
        stamp, at = T0 + k * 5_000_000, (k * 0.02 + np.pi) % (2 * np.pi) - np.pi
        items.append(("/joint_states", stamp, joint_state(stamp, JOINTS, [at] * 4)))
        items.append(("/commands", stamp, joint_state(stamp, JOINTS, [0.0] * 4)))
    write_mcap(tmp_path / "finished.mcap", items, use_chunking=False)
    grown = grow(mapping=JOINTS_ONLY, robot=free)
    grown.append((tmp_path / "finished.mcap").read_bytes(), repeat(20_000))

    expected = imported(tmp_path / "finished.mcap", free, JOINTS_ONLY).trajectory
    assert expected["joint_positions"].max() > 6 * np.pi
    found = grown.rows(free)["joint_positions"]
    assert np.allclose(found, expected["joint_positions"], rtol=0, atol=1e-12)


def test_a_step_comes_when_messages_are_newer_by_the_lag(
    tmp_path: Path, grow: Callable[..., Growth]
):
    items = sorted(recorded(1.5), key=lambda item: item[1])
    grown, whole = grow(), tmp_path / "whole.mcap"
    write_mcap(whole, items, use_chunking=False)
    data = whole.read_bytes()
    ends = [write_mcap(tmp_path / "part.mcap", items[:n], use_chunking=False) for n in (300, 450)]
    for n, end in zip((300, 450), ends, strict=True):
        grown.append(data[grown.path.stat().st_size : end], repeat(10**6))
        newest = max(m.header.stamp.nanosec for t, _, m in items[:n] if t == "/joint_states")
        due = int((newest - LAG) / 1e7)
        assert due - FEWEST <= len(grown.steps) <= due + 1
        assert not grown.bag.has_ended


# ---------------------------------------------------------------- files that follow each other


def split(folder: Path, items: list[Item], cuts: tuple[float, ...] = (0.7, 1.4)) -> list[Path]:
    """Writes items into as many files as there are parts, which rosbag2 would name."""
    folder.mkdir()
    edges, files = [0.0, *cuts, 1e9], list[Path]()
    for k in range(len(edges) - 1):
        low, high = (T0 + edge * 1e9 for edge in edges[k : k + 2])
        files.append(folder / f"walk_{k}.mcap")
        write_mcap(files[-1], [item for item in items if low <= item[1] < high], chunk_size=20_000)
    return files


@pytest.mark.parametrize("is_cut", [False, True])
def test_files_that_follow_each_other_are_one_bag_though_the_next_is_created_first(
    biped: Robot, tmp_path: Path, grow: Callable[..., Growth], *, is_cut: bool
):
    files = split(tmp_path / "finished", recorded(2.0))
    if is_cut:  # its recorder was killed, and another one went on
        files[1].write_bytes(files[1].read_bytes()[:-5000])
    expected = imported(tmp_path / "finished", biped)
    folder = tmp_path / "walk"
    folder.mkdir()
    (folder / files[0].name).write_bytes(b"")
    grown, old, before = grow(folder), folder / files[0].name, b""
    for file in files:
        data, new = file.read_bytes(), folder / file.name
        new.write_bytes(data[:50])  # the head, without a message
        grown.look()
        grown.append(before, repeat(10**6), old)
        grown.append(data[50 : len(data) // 2], repeat(7001), new)
        old, before = new, data[len(data) // 2 :]
    assert not grown.bag.has_ended
    (folder / "metadata.yaml").write_text("rosbag2_bagf")  # as it is being written
    grown.look()
    assert not grown.bag.has_ended
    grown.append(before, repeat(7001), old)

    assert grown.bag.has_ended
    assert len(grown.steps) == expected.trajectory.steps
    assert_same(grown.rows(biped), expected.trajectory)
    notes = [note for note in expected.notes if "has no end" in note]
    assert grown.notes == notes
    assert len(notes) == is_cut


def test_a_file_that_was_cut_has_its_first_steps_and_no_end(
    biped: Robot, tmp_path: Path, grow: Callable[..., Growth]
):
    finished = tmp_path / "finished.mcap"
    write_mcap(finished, recorded(2.0), chunk_size=20_000)
    data, rng = finished.read_bytes(), np.random.default_rng(0)
    expected = imported(finished, biped).trajectory
    for _ in range(8):
        grown = grow()
        grown.append(data[: int(rng.integers(len(data) * 9 // 10))], repeat(30_000))
        assert not grown.bag.has_ended
        assert len(grown.steps) < expected.steps
        if grown.steps:
            assert_same(grown.rows(biped), expected)


# ---------------------------------------------------------------- what a recording may lack


def test_commands_that_begin_later_are_waited_for_and_said(
    biped: Robot, tmp_path: Path, grow: Callable[..., Growth]
):
    items = [item for item in recorded(7.0) if item[0] != "/commands" or item[1] > T0 + 6 * 10**9]
    write_mcap(tmp_path / "finished.mcap", items, use_chunking=False)
    grown = grow()
    grown.append((tmp_path / "finished.mcap").read_bytes(), repeat(20_000))

    expected = imported(tmp_path / "finished.mcap", biped).trajectory
    assert_same(grown.rows(biped), expected)
    assert len(grown.steps) == expected.steps == 98
    assert grown.notes == [f"{grown.path}: no numbers yet on /commands"]


def test_a_topic_that_ends_leaves_its_steps_not_observed(
    biped: Robot, tmp_path: Path, grow: Callable[..., Growth]
):
    items = [item for item in recorded(2.0) if item[0] != "/odom" or item[1] < T0 + 10**9]
    write_mcap(tmp_path / "finished.mcap", items, use_chunking=False)
    grown = grow()
    grown.append((tmp_path / "finished.mcap").read_bytes(), repeat(4001))

    expected = imported(tmp_path / "finished.mcap", biped).trajectory
    found = grown.rows(biped)
    assert expected.steps < 100
    assert found.steps == 150
    assert_same(found.first(expected.steps), expected)
    assert np.isnan(found["base_position"][expected.steps + 1 :]).all()
    assert np.isfinite(found["joint_positions"]).all()


def test_messages_that_come_late_or_with_a_wrong_stamp_delay_no_step(
    biped: Robot, tmp_path: Path, grow: Callable[..., Growth]
):
    late = [
        (topic, time + (10**9 if topic == "/imu" else 0), message)
        for topic, time, message in recorded(3.0)
    ]
    stray = joint_state(T0 + 30 * 10**9, JOINTS, [9.0] * 4)
    late.append(("/joint_states", T0 + 10**9, stray))
    write_mcap(tmp_path / "finished.mcap", late, use_chunking=False)
    grown = grow()
    grown.append((tmp_path / "finished.mcap").read_bytes(), repeat(1500))

    found, expected = grown.rows(biped), imported(tmp_path / "finished.mcap", biped).trajectory
    assert grown.notes == ["/imu: messages come more than 0.5 s late, and are missing"]
    assert np.isnan(found["base_angular_velocity"][60:150]).all()
    for signal in ("joint_positions", "commands", "base_position"):
        assert np.array_equal(found[signal], expected[signal][: found.steps])


def test_memory_is_that_of_some_seconds(grow: Callable[..., Growth]):
    kind = "sensor_msgs/msg/JointState"
    payload = bytes(ROS.serialize_cdr(joint_state(0, JOINTS, [0.1] * 4), kind))
    grown, sizes = grow(mapping=f'clock = "log"\n{JOINTS_ONLY}'), list[int]()
    with grown.path.open("ab") as file:
        writer = Writer(file, use_chunking=False)
        writer.start("ros2")
        schema = writer.register_schema(kind, "ros2msg", b"")
        channels = [
            writer.register_channel(topic, "cdr", schema)
            for topic in ("/joint_states", "/commands")
        ]
        tracemalloc.start()
        for k in range(1200):
            for channel in channels:
                writer.add_message(channel, T0 + k * 20_000_000, payload, 0)
            if k % 50 == 0:
                file.flush()
                grown.look()
                grown.steps.clear()
                sizes.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    assert grown.bag.steps > 2200
    assert sizes[-1] - sizes[10] < 40_000  # bytes; the numbers of those messages are 200,000


# ---------------------------------------------------------------- what is refused


def test_a_clock_that_restarts_is_refused_with_what_to_do(
    tmp_path: Path, grow: Callable[..., Growth]
):
    items = [
        (topic, T0 + n * 5_000_000, joint_state(start + k * 5_000_000, JOINTS, [0.1] * 4))
        for n, (start, k) in enumerate(product((T0 + 20 * 10**9, T0), range(400)))
        for topic in ("/joint_states", "/commands")
    ]
    write_mcap(tmp_path / "finished.mcap", items, use_chunking=False)
    grown = grow(mapping=JOINTS_ONLY)
    with pytest.raises(InputError, match=r"clock restarts after 1\d\d steps.*without --follow"):
        grown.append((tmp_path / "finished.mcap").read_bytes(), repeat(3000))


def test_a_clock_that_jumps_far_ahead_is_refused(tmp_path: Path, grow: Callable[..., Growth]):
    items = [
        (topic, stamp, joint_state(stamp, JOINTS, [0.1] * 4))
        for k in range(400)
        for stamp in [10**9 + k * 5_000_000 + (T0 if k >= 300 else 0)]
        for topic in ("/joint_states", "/commands")
    ]
    write_mcap(tmp_path / "finished.mcap", items, use_chunking=False)
    grown = grow(mapping=JOINTS_ONLY)
    with pytest.raises(InputError, match=r"jumps forward by 1\d{9} s at .* start the watch again"):
        grown.append((tmp_path / "finished.mcap").read_bytes(), repeat(3000))


def test_a_file_that_its_recorder_began_anew_is_refused(
    tmp_path: Path, grow: Callable[..., Growth]
):
    write_mcap(tmp_path / "finished.mcap", recorded(), use_chunking=False)
    grown, data = grow(), (tmp_path / "finished.mcap").read_bytes()
    grown.append(data[:-9000], repeat(10**6))
    grown.path.write_bytes(data[:9000])
    with pytest.raises(InputError, match=r"grown\.mcap: .* began it anew: start the watch again"):
        grown.look()


@pytest.mark.parametrize("is_replaced", [True, False])
def test_another_file_of_the_same_name_is_refused_and_one_that_was_moved_is_read_on(
    tmp_path: Path, grow: Callable[..., Growth], *, is_replaced: bool
):
    write_mcap(tmp_path / "finished.mcap", recorded(), use_chunking=False)
    grown, data = grow(), (tmp_path / "finished.mcap").read_bytes()
    grown.append(data[:-9000], repeat(10**6))
    moved = grown.path.rename(tmp_path / "moved.mcap")
    if is_replaced:
        grown.path.write_bytes(data)  # longer than what was read
        with pytest.raises(InputError, match=r"grown\.mcap: .* another file .* start the watch"):
            grown.look()
    else:
        with moved.open("ab") as file:
            file.write(data[-9000:])
        assert grown.look() > 0


def test_other_formats_and_the_mapping_of_a_table_are_refused_with_what_to_do(
    tmp_path: Path, grow: Callable[..., Growth]
):
    for form in ("sqlite", "mcap-file"):
        folder = write_bag(tmp_path / form, recorded(0.2), form)
        with pytest.raises(InputError, match=r"ros2 bag record -s mcap"):
            grow(folder)
    (tmp_path / "table.csv").write_text("time\n")
    table = '[time]\ncolumn = "time"\n'
    joints_only = JOINTS_ONLY.replace('topic = "/joint_states"\n', "").replace(
        'topic = "/commands"\n', ""
    )
    with pytest.raises(InputError, match=r"MAP\.toml:\d+: \[time\] is for tables: --follow is for"):
        grow(tmp_path / "table.csv", joints_only + table)
    (tmp_path / "text.mcap").write_text("nothing")
    with pytest.raises(InputError, match=r"text\.mcap: the bag is damaged"):
        grow(tmp_path / "text.mcap").look()
    with pytest.raises(InputError, match=r"none\.mcap"):
        grow(tmp_path / "none.mcap")


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (('"LHX"', '"LHZ"'), r"MAP\.toml:\d+: .*'LHZ'"),
        (("/left_foot", "/commands"), r"MAP\.toml:\d+: .*index"),
    ],
    ids=["name", "type"],
)
def test_a_mapping_that_does_not_fit_is_refused_with_its_line(
    change: tuple[str, str], error: str, tmp_path: Path, grow: Callable[..., Growth]
):
    write_mcap(tmp_path / "finished.mcap", recorded(), use_chunking=False)
    data = (tmp_path / "finished.mcap").read_bytes()[:-20_000]
    with pytest.raises(InputError, match=error):
        grow(mapping=MAPPING.replace(*change)).append(data, repeat(10**6))


def test_a_bag_that_ends_without_a_topic_of_the_mapping_is_refused(
    tmp_path: Path, grow: Callable[..., Growth]
):
    items = [item for item in recorded() if item[0] != "/odom"]
    write_mcap(tmp_path / "finished.mcap", items)
    with pytest.raises(InputError, match=r"MAP\.toml:\d+: .*/odom"):
        grow().append((tmp_path / "finished.mcap").read_bytes(), repeat(10**6))


def test_a_damaged_record_is_refused(tmp_path: Path, grow: Callable[..., Growth]):
    write_mcap(tmp_path / "finished.mcap", recorded(), chunk_size=20_000)
    data = bytearray((tmp_path / "finished.mcap").read_bytes())
    data[len(data) // 3] ^= 0x10
    with pytest.raises(InputError, match=r"grown\.mcap: the bag is damaged.*record it again"):
        grow().append(bytes(data), repeat(10**6))
