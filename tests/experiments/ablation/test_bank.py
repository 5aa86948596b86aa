"""Promises of a given bank of gaits: its files are found, checked, and part of the cells."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.errors import InputError
from selfmodel.experiments.ablation import bank
from selfmodel.experiments.study.gaits import FILE, read_gait, write_gait
from selfmodel.experiments.study.planned_robots import planned
from selfmodel.logs.controllers import controller_bytes
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot


@pytest.fixture
def gait(quadruped: Robot) -> Controller:
    design = network_for(quadruped)
    return Controller(design, draw_genomes(np.random.default_rng(0), (design.weights,)))


def test_a_gait_of_a_bank_is_written_as_it_was(gait: Controller, quadruped: Robot, tmp_path: Path):
    (tmp_path / "quadruped-3.npz").write_bytes(controller_bytes(gait))
    cell = bank.given_gait(tmp_path, planned("quadruped"), 3)
    (tmp_path / "cell").mkdir()
    bank.write(cell, {}, tmp_path / "cell")

    assert read_gait(tmp_path / "cell", quadruped) == gait
    assert (tmp_path / "cell" / FILE).read_bytes() == (tmp_path / "quadruped-3.npz").read_bytes()


def test_the_gaits_of_another_study_are_a_bank(gait: Controller, tmp_path: Path):
    (tmp_path / "quadruped-3.npz").write_bytes(controller_bytes(gait))
    other = tmp_path / "gaits"
    (other / "quadruped-seed003-gait-0123456789abcdef").mkdir(parents=True)
    write_gait(other / "quadruped-seed003-gait-0123456789abcdef", gait)

    given, evolved = (
        bank.given_gait(folder, planned("quadruped"), 3) for folder in (tmp_path, other)
    )
    assert given.place == evolved.place


def test_another_gait_is_another_cell(gait: Controller, tmp_path: Path):
    other = Controller(gait.design, -gait.genome)
    for number, one in enumerate((gait, other)):
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "quadruped-0.npz").write_bytes(controller_bytes(one))
    first, second = (bank.given_gait(tmp_path / n, planned("quadruped"), 0) for n in "01")

    assert first.place != second.place


def test_a_gait_that_a_bank_lacks_is_named(tmp_path: Path):
    with pytest.raises(InputError, match=r"quadruped-1\.npz: expected a controller file"):
        bank.given_gait(tmp_path, planned("quadruped"), 1)


def test_a_gait_of_another_robot_is_refused(gait: Controller, tmp_path: Path):
    (tmp_path / "hexapod-0.npz").write_bytes(controller_bytes(gait))
    with pytest.raises(InputError, match=r"hexapod-0\.npz has a controller for"):
        bank.given_gait(tmp_path, planned("hexapod"), 0)
