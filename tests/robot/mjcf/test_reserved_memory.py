"""Tests of the memory that an MJCF reserves for contacts and constraints."""

from pathlib import Path

import pytest

from selfmodel.robot.mjcf.load import AdaptedMjcf, adapt, robot_from
from selfmodel.robot.mjcf.settings import MjcfSettings
from tests.robot.mjcf.awkward import mjcf
from tests.robot.mjcf.test_adaptation import written


def adapted(folder: Path, size: str) -> AdaptedMjcf:
    return adapt(written(folder, mjcf(more=size)), MjcfSettings())


def test_a_large_reservation_is_left_out_and_noted(tmp_path: Path):
    large = adapted(tmp_path, '<size njmax="8000" nconmax="4000"/>')
    plain = adapted(tmp_path, "")

    assert any("without njmax=8000, nconmax=4000" in note for note in large.notes)
    assert robot_from(large, "a").model.narena == robot_from(plain, "a").model.narena


@pytest.mark.parametrize("size", ['<size njmax="500" nconmax="100"/>', '<size memory="30M"/>'])
def test_a_usual_reservation_stays(tmp_path: Path, size: str):
    assert size.strip("</>") in adapted(tmp_path, size).mjcf
