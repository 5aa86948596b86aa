"""Tests of awkward files: each gives a robot that moves, or is refused in one sentence."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.signals import SIGNALS
from tests.helpers.drivers import random_controllers
from tests.helpers.exactness import exactness
from tests.robot.mjcf.awkward import AWKWARD

SECONDS_EACH = 5

STEPS = 20

ROUNDING = 1e-9
"""Largest error of a prediction from a logged state: the base of a planar robot is logged as a
position and a quaternion."""


@pytest.mark.parametrize("what", [what for what, case in AWKWARD.items() if not case.sentence])
def test_an_awkward_but_valid_file_gives_a_robot_that_moves(what: str, tmp_path: Path):
    path = AWKWARD[what].write(tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}

    robot = load_mjcf(path)
    runs = [(INTACT, controller) for controller in random_controllers(robot, 2)]
    outcome = Simulator(robot, 1).run(runs, STEPS, SIGNALS)
    found = exactness(robot, INTACT, runs[0][1], STEPS)

    assert found.prediction <= ROUNDING
    assert found.displacement == 0.0
    assert not outcome.diverged.any()
    assert np.isfinite(outcome.behaviour["base_position"]).all()
    assert before == {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}


@pytest.mark.parametrize(
    "what",
    [what for what, case in AWKWARD.items() if case.sentence],
)
def test_an_invalid_file_is_refused_in_one_sentence(what: str, tmp_path: Path):
    path = AWKWARD[what].write(tmp_path)

    with pytest.raises(InputError) as refusal:
        load_mjcf(path)

    said = str(refusal.value)
    assert said.startswith(str(path.parent))
    assert AWKWARD[what].sentence in said
    assert "\n" not in said
    assert len(said) < 500


def test_there_are_enough_awkward_files():
    assert len(AWKWARD) >= 30


@pytest.mark.process
def test_no_file_takes_long_or_ends_the_process(tmp_path: Path):
    code = (
        "import sys\nfrom pathlib import Path\n"
        "from selfmodel.errors import InputError\nfrom selfmodel.robot.mjcf.load import load_mjcf\n"
        "from tests.robot.mjcf.awkward import AWKWARD\n"
        "for number, case in enumerate(AWKWARD.values()):\n"
        "    folder = Path(sys.argv[1]) / str(number)\n"
        "    try:\n        load_mjcf(case.write(folder))\n"
        "    except InputError:\n        pass\n"
    )
    root = Path(__file__).parents[3]
    command = [sys.executable, "-c", code, str(tmp_path)]

    subprocess.run(command, check=True, cwd=root, timeout=SECONDS_EACH * len(AWKWARD))
