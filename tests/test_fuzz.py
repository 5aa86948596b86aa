"""Every reader of a file, given thousands of damaged ones: ``-m fuzz``; ``FUZZ=100000`` for more.

A reader refuses a damaged file with an ``InputError`` or a ``LogError`` in one line, or reads it.
What has a checksum is then read as it was written; ``tests/logs/test_damage.py`` has a few cases of
that in every run.
"""

import os
import random
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from selfmodel.errors import InputError, WorkError
from selfmodel.isolation import Message
from selfmodel.logs import read_log
from selfmodel.logs.controllers import controller_bytes, parse_controller
from selfmodel.logs.inspection import read_info
from selfmodel.logs.recordings.bags import read_in_child as read_bag
from selfmodel.logs.recordings.mapping_file import parse_mapping
from selfmodel.logs.recordings.tables import read_in_child as read_table
from selfmodel.logs.results import read_result, result_bytes
from selfmodel.logs.salvage import salvageable_steps
from selfmodel.robot.mjcf.settings import read_settings
from selfmodel.robot.mjcf.untrusted import checked_model
from tests.helpers.damage import spoilt
from tests.logs.conftest import MJCF
from tests.logs.recordings.bags import FORMS, write_bag
from tests.logs.recordings.conftest import MAPPING, recorded

BAGS = tuple(form for form in FORMS if form.startswith("mcap"))
"""SQLite has no checksums; ``tests/logs/recordings/test_bags.py`` damages such bags."""

EXAMPLES = int(os.environ.get("FUZZ", "300"))

NAMES = (
    *("log", "info", "salvage", "controller", "result", "model", "settings", "mapping"),
    *("csv", "npz", *BAGS),
)


@dataclass(frozen=True)
class Target:
    """A reader and a sound file for it.

    Attributes:
        name: Name of the file.
        data: Content of the sound file.
        read: Reads a file.
    """

    name: str
    data: bytes
    read: Callable[[Path], object]


@pytest.fixture(scope="module")
def targets(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Target]:
    """Returns a target for each format, by its name."""
    folder = tmp_path_factory.mktemp("sound")
    log = Path(__file__).parent / "data" / "logs-0.1" / "trials" / "clock.mcap"
    controller = controller_bytes(read_log(log).trial.plan.controller)
    np.savez_compressed(folder / "t.npz", time=np.arange(9.0), q=np.ones((9, 2)))
    rows = "\n".join(f"{0.1 * k},{k}" for k in range(20))
    found = [
        Target("log.mcap", log.read_bytes(), read_log),
        Target("info.mcap", log.read_bytes(), read_info),
        Target("salvage.mcap", log.read_bytes(), salvageable_steps),
        Target("c.npz", controller, lambda path: parse_controller(path.read_bytes(), "c.npz")),
        Target("result.json", result_bytes({"a": [1, {"b": 0.5}]}), _result),
        Target("robot.xml", MJCF.encode(), _model),
        Target("robot.toml", b'base = "free"\nforward = "+x"\n[kp]\nhip = 2.0\n', read_settings),
        Target("map.toml", MAPPING.encode(), _mapping),
        Target("t.csv", f"time,q\n{rows}\n".encode(), _table),
        Target("t.npz", (folder / "t.npz").read_bytes(), _table),
    ]
    for form in BAGS:
        bag = write_bag(folder / form, recorded(0.3), form)
        (file,) = (path for path in bag.iterdir() if path.suffix != ".yaml")
        found.append(Target(file.name, file.read_bytes(), _bag))
    return dict(zip(NAMES, found, strict=True))


def _result(path: Path) -> object:
    return read_result(path, "a result", "delete it")


def _model(path: Path) -> object:
    text = path.read_bytes().decode(errors="replace")
    try:
        return checked_model(text, {})
    except ValueError as error:
        raise InputError(str(error)) from error


def _mapping(path: Path) -> object:
    return parse_mapping(path.read_bytes().decode(errors="replace"), path.name)


def _table(path: Path) -> object:
    return read_table(
        Message({"path": str(path), "wanted": ["q", "q.0"], "time": "time", "unit": 1})
    )


def _bag(path: Path) -> object:
    return read_bag(Message({"path": str(path), "topics": None}))


@pytest.mark.fuzz
@pytest.mark.parametrize("name", NAMES)
def test_a_damaged_file_is_read_or_refused_in_one_line(
    name: str, targets: Mapping[str, Target], tmp_path: Path
):
    target = targets[name]
    path = tmp_path / target.name

    @settings(max_examples=EXAMPLES, deadline=None)
    @given(st.integers(0, 2**63))
    @example(2860)  # in mcap-chunks, a chunk of 24 TB
    def is_read_or_refused(seed: int) -> None:
        path.write_bytes(spoilt(target.data, random.Random(seed)))  # noqa: S311 - no secret
        sentence = ""
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                target.read(path)
            except (InputError, WorkError) as error:
                sentence = str(error)
        left = {file.name for file in tmp_path.iterdir()}
        path.unlink()
        assert "\n" not in sentence
        assert left == {path.name}

    is_read_or_refused()
