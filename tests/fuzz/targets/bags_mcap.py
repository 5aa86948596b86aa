"""rosbag2 recordings as MCAP: records with other content, in every packing, and damaged bytes."""

import dataclasses
from functools import partial
from pathlib import Path

import numpy as np
import zstandard
from mcap.records import Message

from selfmodel.logs.rosbag.mapping_file import parse_mapping
from tests.fuzz.bag_checks import check_bag
from tests.fuzz.mcap_file import COMPRESSIONS, McapFile, read_file, written
from tests.fuzz.mutate import data as raw, jsons
from tests.fuzz.mutate.numbers import text
from tests.fuzz.sealed import channel, messages, names, payload, schema, time
from tests.fuzz.seeds import biped, recording
from tests.fuzz.target import Case, Make, Target
from tests.logs.rosbag.bags import storage, write_bag
from tests.logs.rosbag.conftest import MAPPING

SECONDS = 0.25
OPERATORS = (payload, payload, payload, names, time, messages, messages, channel, schema)


def prepare(folder: Path) -> Make:
    """Returns the maker of bags."""
    bag = write_bag(folder / "bag", recording(SECONDS))
    data, metadata = storage(bag).read_bytes(), (bag / "metadata.yaml").read_bytes()
    file, robot, mapping = read_file(data), biped(), parse_mapping(MAPPING, "MAP.toml")

    def make(rng: np.random.Generator) -> Case:
        check = partial(check_bag, mapping=mapping, robot=robot)
        kind = rng.random()
        if kind < 0.15:
            new, what = raw.mutated(data, rng)
            return Case(what, {"bag.mcap": new}, partial(check, "bag.mcap"))
        if kind < 0.25:
            new, what = _metadata(metadata, rng)
            files = {"bag/bag.mcap": data, "bag/metadata.yaml": new}
            return Case(f"metadata {what}", files, partial(check, "bag"))
        new, what = _mutated(file, rng)
        if kind < 0.3:
            name, packed = "bag.mcap.zstd", zstandard.compress(new)
            packed, damage = raw.mutated(packed, rng) if kind < 0.27 else (packed, "whole")
            return Case(f"{what}; packed, {damage}", {name: packed}, partial(check, name))
        return Case(what, {"bag.mcap": new}, partial(check, "bag.mcap"))

    return make


def _mutated(file: McapFile, rng: np.random.Generator) -> tuple[bytes, str]:
    changed = file.copy()
    what = []
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        operator = OPERATORS[rng.integers(len(OPERATORS))]
        what.append(f"{operator.__name__}: {operator(changed, rng)}")
    if rng.random() < 0.1:
        what.append("messages packed")
        for index, item in enumerate(changed.items):
            if isinstance(item, Message):
                new = zstandard.compress(item.data)
                if rng.random() < 0.01:
                    new = raw.mutated(new, rng)[0]
                changed.items[index] = dataclasses.replace(item, data=new)
    packing = COMPRESSIONS[rng.integers(len(COMPRESSIONS))]
    chunk = (None, 2**10, 2**18)[rng.integers(3)]
    checksums = bool(rng.random() < 0.5)
    return written(changed, packing, chunk, checksums=checksums), "; ".join(what)


def _metadata(data: bytes, rng: np.random.Generator) -> tuple[bytes, str]:
    lines = data.decode().split("\n")
    at = int(rng.integers(len(lines)))
    kind = int(rng.integers(5))
    if kind == 0:
        return raw.mutated(data, rng)
    if kind == 1:
        lines[at] = lines[at].partition(":")[0] + ": " + text(rng)
    elif kind == 2:
        lines.insert(int(rng.integers(len(lines))), lines.pop(at))
    elif kind == 3:
        lines[at] = "&a [*a, *a]" if rng.random() < 0.5 else "!!python/object:os.system x"
    else:
        return jsons.mutated(
            b'{"rosbag2_bagfile_information": {"relative_file_paths": ["bag.mcap"], "version": 9}}',
            rng,
        )
    return "\n".join(lines).encode("utf-8", "replace"), f"line {at + 1} kind {kind}"


TARGET = Target("bags-mcap", 10, prepare)
