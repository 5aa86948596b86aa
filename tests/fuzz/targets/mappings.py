"""Mappings from topics to roles, as TOML: values of other types, other names, other structure."""

from functools import partial
from pathlib import Path

import numpy as np

from selfmodel.logs.recordings.importer import import_recording
from selfmodel.logs.recordings.mapping.mapping_file import read_mapping
from selfmodel.robot.robot import Robot
from tests.fuzz.mutate import tomls
from tests.fuzz.seeds import DATA, OTHER_MAPPING, biped, recording
from tests.fuzz.target import Case, Make, Target
from tests.logs.recordings.conftest import MAPPING
from tests.logs.recordings.rosbag.bags import storage, write_bag

SECONDS = 0.1
NAME = "map.toml"


def prepare(folder: Path) -> Make:
    """Returns the maker of mappings."""
    bag = storage(write_bag(folder / "bag", recording(SECONDS)))
    robot = biped()
    seeds = (
        MAPPING.encode(),
        OTHER_MAPPING.encode(),
        (DATA / "imported" / "map.toml").read_bytes(),
    )

    def make(rng: np.random.Generator) -> Case:
        data, what = tomls.mutated(seeds[rng.integers(len(seeds))], rng)
        return Case(what, {NAME: data}, partial(_check, bag, robot))

    return make


def _check(bag: Path, robot: Robot) -> str:
    mapping = read_mapping(Path(NAME))
    recorded = import_recording(bag, mapping, robot)
    return f"imported {min(recorded.behaviour.steps, 3)} steps or more"


TARGET = Target("mappings", 6, prepare)
