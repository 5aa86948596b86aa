"""ROS 1 bags: other content with right offsets, and damaged records, indexes and bytes.

The format has no checksums of its own, so another number in a message cannot be noticed. Where the
messages themselves are as they were, they must be read as they were written, or refused.
"""

from functools import partial
from pathlib import Path

import numpy as np

from selfmodel.logs.recordings.mapping.mapping import RecordingMapping
from selfmodel.logs.recordings.mapping.mapping_file import parse_mapping
from selfmodel.logs.recordings.rosbag.bag import Bag, read_bag
from selfmodel.logs.recordings.series import Series
from selfmodel.robot.robot import Robot
from tests.fuzz.bag_checks import check_bag
from tests.fuzz.mutate import data as raw, ros1s
from tests.fuzz.ros1_file import COMPRESSIONS, laid_out, read_file
from tests.fuzz.seeds import OTHER_MAPPING, biped, recording
from tests.fuzz.target import Case, Make, Target
from tests.logs.recordings.conftest import MAPPING
from tests.logs.recordings.rosbag.bags import write_ros1

SECONDS = 0.12
NAME = "walk.bag"


def prepare(folder: Path) -> Make:
    """Returns the maker of bags."""
    path = write_ros1(folder / NAME, recording(SECONDS))
    file, robot = read_file(path.read_bytes()), biped()
    topics = [topic for topic, *_ in recording(SECONDS)]
    whole = read_bag(path, topics)
    forms = {form: laid_out(file, form) for form in COMPRESSIONS}
    mappings = [parse_mapping(text, "MAP.toml") for text in (MAPPING, OTHER_MAPPING)]

    def make(rng: np.random.Generator) -> Case:
        mapping = mappings[rng.integers(len(mappings))]
        form = list(COMPRESSIONS)[rng.integers(len(COMPRESSIONS))]
        kind = rng.random()
        if kind < 0.45:
            changed, what = ros1s.content_changed(file, rng)
            data, whole_messages = ros1s.joined(laid_out(changed, form)), False
        elif kind < 0.8:
            data, what = ros1s.structure_changed(forms[form], rng)
            whole_messages = True
        else:
            data, what = raw.mutated(ros1s.joined(forms[form]), rng)
            whole_messages = form == b"bz2"  # it has checksums
        check = partial(_check, mapping, robot, whole if whole_messages else None)
        return Case(f"{form.decode()}: {what}", {NAME: data}, check)

    return make


def _check(mapping: RecordingMapping, robot: Robot, whole: Bag | None) -> str:
    if whole is not None:
        _check_same(read_bag(Path(NAME), whole.topics), whole)
    return check_bag(NAME, mapping, robot)


def _check_same(read: Bag, whole: Bag) -> None:
    """Checks that the messages are those that were written, unless a topic has another name."""
    found, expected = (
        {(topic.name, topic.type) for topic in bag.topics.values()} for bag in (read, whole)
    )
    if found != expected:
        return
    if read.topics != whole.topics:
        raise AssertionError("a topic has more or fewer messages")
    for name, written in whole.series.items():
        if _content(read.series[name]) != _content(written):
            raise AssertionError(f"the messages on {name} have changed")


def _content(series: Series) -> tuple[bytes, ...]:
    columns = [(column.index, column.values) for column in series.columns.values()]
    arrays = [series.stamps, series.logged, *(array for pair in columns for array in pair)]
    return (*map(str.encode, series.columns), *(array.tobytes() for array in arrays))


TARGET = Target("bags-ros1", 8, prepare)
