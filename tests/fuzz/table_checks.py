"""Checks of a table: an import with the mapping of the biped, and a suggested mapping."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from selfmodel.logs.recordings.mapping.mapping_file import parse_mapping
from tests.fuzz.bag_checks import check_bag
from tests.fuzz.seeds import biped
from tests.fuzz.target import Case, Make
from tests.logs.recordings.tables.tables import MAPPING, WRITERS, columns

Mutate = Callable[[bytes, np.random.Generator], tuple[bytes, str]]


def tables(form: str, mutate: Mutate, folder: Path) -> Make:
    """Returns the maker of mutated tables.

    Args:
        form: Format, a key of ``WRITERS``.
        mutate: Function from the bytes of a table to those of another, with a description.
        folder: An empty folder.
    """
    name = f"table.{form}"
    data = WRITERS[form](folder / name, columns()).read_bytes()
    robot, mapping = biped(), parse_mapping(MAPPING, "MAP.toml")

    def make(rng: np.random.Generator) -> Case:
        new, what = mutate(data, rng)
        return Case(what, {name: new}, partial(check_bag, name, mapping, robot))

    return make
