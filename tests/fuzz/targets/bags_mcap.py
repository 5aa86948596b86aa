"""rosbag2 recordings as MCAP: records with other content, in every packing, and damaged bytes."""

import dataclasses
from functools import partial
from pathlib import Path

import numpy as np
import zstandard
from mcap.records import Message

from selfmodel.logs.recordings.mapping.mapping_file import parse_mapping
from tests.fuzz.bag_checks import check_bag
from tests.fuzz.mcap_file import McapFile, read_file
from tests.fuzz.mutate import data as raw, jsons, records
from tests.fuzz.mutate.numbers import text
from tests.fuzz.seeds import OTHER_MAPPING, biped, recording
from tests.fuzz.target import Case, Make, Target
from tests.logs.recordings.conftest import MAPPING
from tests.logs.recordings.rosbag.bags import storage, write_bag

SECONDS = 0.25


def prepare(folder: Path) -> Make:
    """Returns the maker of bags."""
    bag = write_bag(folder / "bag", recording(SECONDS))
    data, metadata = storage(bag).read_bytes(), (bag / "metadata.yaml").read_bytes()
    file, robot = read_file(data), biped()
    mappings = [parse_mapping(text, "MAP.toml") for text in (MAPPING, OTHER_MAPPING)]

    def make(rng: np.random.Generator) -> Case:
        mapping = mappings[rng.integers(len(mappings))]
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
    changed, names = records.mutated(file, records.BAG, rng)
    if rng.random() < 0.1:
        names.append("messages packed")
        for index, item in enumerate(changed.items):
            if isinstance(item, Message):
                new = zstandard.compress(item.data)
                if rng.random() < 0.01:
                    new = raw.mutated(new, rng)[0]
                changed.items[index] = dataclasses.replace(item, data=new)
    checksums = bool(rng.random() < 0.5)
    return records.packed(changed, rng, checksums=checksums), "; ".join(names)


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


TARGET = Target("bags-mcap", 9, prepare)
