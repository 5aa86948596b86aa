"""rosbag2 recordings as SQLite: rows, columns and tables with other content, and damaged pages."""

from functools import partial
from pathlib import Path

import numpy as np

from selfmodel.logs.recordings.mapping.mapping_file import parse_mapping
from tests.fuzz.bag_checks import check_bag
from tests.fuzz.mutate import sqlites
from tests.fuzz.seeds import OTHER_MAPPING, biped, recording
from tests.fuzz.target import Case, Make, Target
from tests.logs.recordings.conftest import MAPPING
from tests.logs.recordings.rosbag.bags import storage, write_bag

SECONDS = 0.15


def prepare(folder: Path) -> Make:
    """Returns the maker of bags."""
    data = storage(write_bag(folder / "bag", recording(SECONDS), "sqlite")).read_bytes()
    robot = biped()
    mappings = [parse_mapping(text, "MAP.toml") for text in (MAPPING, OTHER_MAPPING)]

    def make(rng: np.random.Generator) -> Case:
        copy = folder / f"copy-{int(rng.integers(2**62))}.db3"
        copy.write_bytes(data)
        new, what = sqlites.mutated(copy, rng)
        copy.unlink()
        mapping = mappings[rng.integers(len(mappings))]
        return Case(what, {"bag.db3": new}, partial(check_bag, "bag.db3", mapping, robot))

    return make


TARGET = Target("bags-sqlite", 8, prepare)
