"""Controller files: ``.npz`` archives with other arrays, headers and packing."""

from functools import partial
from pathlib import Path

import numpy as np

from selfmodel.controllers.controller import make_batch
from selfmodel.errors import InputError
from selfmodel.experiments.trial_logs import controller
from selfmodel.logs.controllers import controller_bytes, load_controller, parse_controller
from selfmodel.robot.robot import Robot
from tests.fuzz.mutate import npzs
from tests.fuzz.seeds import DATA, biped, trial_log
from tests.fuzz.target import Case, Make, Target

NAME = "controller.npz"


def prepare(folder: Path) -> Make:
    """Returns the maker of controllers."""
    robot = biped()
    own = controller(trial_log(folder / "trial.mcap", robot, 2), robot)
    seeds = [controller_bytes(own)]
    seeds += [(DATA / "controllers" / f"{name}.npz").read_bytes() for name in ("cpg", "network")]

    def make(rng: np.random.Generator) -> Case:
        data, what = npzs.mutated(seeds[rng.integers(len(seeds))], rng)
        return Case(what, {NAME: data}, partial(_check, robot))

    return make


def _check(robot: Robot) -> str:
    path = Path(NAME)
    found = load_controller(path)
    if parse_controller(controller_bytes(found), "again") != found:
        raise AssertionError("it is written and read as another controller")
    batch = make_batch([found], [()], len(found.design.sensors))
    commands = np.zeros((1, len(found.design.motors)))
    for _ in range(3):
        batch.step(commands)
    try:
        controller(path, robot)
    except InputError:
        return "loaded"
    return "fits"


TARGET = Target("controllers", 5, prepare)
