"""Bank of gaits that is given: controllers of the healthy robots, from files of the user."""

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from selfmodel import arguments
from selfmodel.controllers.controller import Controller
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.study.files import key_of
from selfmodel.experiments.study.gaits import FILE, GAIT, GAITS
from selfmodel.files import read_file
from selfmodel.logs.files import replace_file
from selfmodel.logs.result_files import MAX_BYTES

WRITE = "selfmodel.experiments.ablation.bank:write"


def given_gait(bank: Path, robot: Mapping[str, str], number: int) -> Cell:
    """Returns the cell of a gait of a bank; its parameters contain the file.

    Args:
        bank: Folder with the file ``ROBOT-K.npz``, or the gaits of another study.
        robot: The robot, as planned.
        number: Number of the gait, from 0.

    Raises:
        InputError: The bank has no such gait, or the gait is for another robot.
    """
    gait(bank, robot["robot"], number)
    data = read_file(_path(bank, robot["robot"], number), "a gait", MAX_BYTES)
    parameters = {**robot, "controller": base64.b64encode(data).decode()}
    return Cell(WRITE, f"{key_of(robot['robot'])}-{number}", parameters, number, GAIT, GAITS)


def gait(bank: Path, robot: str, number: int) -> Controller:
    """Returns a gait of a bank.

    Raises:
        InputError: The bank has no such gait, or the gait is for another robot.
    """
    return arguments.read_controller(
        _path(bank, robot, number), arguments.robot_entry(robot).robot()
    )


def _path(bank: Path, robot: str, number: int) -> Path:
    key = key_of(robot)
    evolved = sorted(bank.glob(f"{key}-seed{number:03d}-{GAIT}-*/{FILE}"))
    own = bank / f"{key}-{number}.npz"
    return evolved[0] if evolved and not own.exists() else own


def write(cell: Cell, _needs: Mapping[str, Path], folder: Path) -> dict[str, Any]:
    """Writes the gait into the folder of its cell."""
    replace_file(folder / FILE, base64.b64decode(cell.parameters["controller"]))
    return {"evaluations": 0}
