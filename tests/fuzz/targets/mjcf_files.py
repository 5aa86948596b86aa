"""MJCF files of users, with their assets and settings: adapted, simulated and logged."""

from pathlib import Path

import numpy as np

from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.robots import robot_of
from selfmodel.logs.verify import verify
from selfmodel.logs.writing.writer import write_trial
from selfmodel.robot.mjcf.load import load_mjcf
from selfmodel.robot.mjcf.settings import read_settings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from tests.fuzz.mutate import data as raw, tomls, xmls
from tests.fuzz.seeds import DATA, SETTINGS
from tests.fuzz.target import Case, Make, Target
from tests.logs.conftest import MJCF, made_up, plan_of
from tests.robot.mjcf.awkward import AWKWARD, Awkward

NAME = "robot.xml"
STEPS = 3
MAX_SEED = 20_000
"""Largest text of a seed, characters."""

TOML = b"""\
forward = "x"
keyframe = "none"
control_timestep = 0.02
touch = ["left_foot"]
ctrlrange = [-1, 1]
"""


def prepare(folder: Path) -> Make:  # noqa: ARG001  # its seeds are in the repository
    """Returns the maker of MJCF files."""
    mesh = (DATA / "mjcf" / "foot.obj").read_bytes()
    tripod = (DATA / "mjcf" / "tripod.xml").read_bytes()
    usual = ((MJCF.encode(), {}), (tripod, {"foot.obj": mesh}))
    odd = [_contents(found) for found in AWKWARD.values() if len(found.text) < MAX_SEED]

    def make(rng: np.random.Generator) -> Case:
        seeds = usual if rng.random() < 0.6 else odd
        model, assets = seeds[rng.integers(len(seeds))]
        files = {NAME: model, **assets}
        kind = rng.random()
        if kind < 0.1:
            files["robot.toml"], what = tomls.mutated(TOML, rng)
        elif kind < 0.2 and assets:
            name = str(rng.choice(sorted(assets)))
            files[name], what = raw.mutated(assets[name], rng)
        else:
            files[NAME], what = xmls.mutated(model, rng)
        return Case(what, files, _check)

    return make


def _contents(found: Awkward) -> tuple[bytes, dict[str, bytes]]:
    """The MJCF and the other files of an example, those in its folder."""
    files = {name: data for name, data in found.files.items() if not name.startswith("..")}
    return _bytes(found.text), {name: _bytes(data) for name, data in files.items()}


def _bytes(text: str | bytes) -> bytes:
    return text.encode() if isinstance(text, str) else text


def _check() -> str:
    path = Path(NAME)
    robot = load_mjcf(path, read_settings(path))
    return logged(robot)


def logged(robot: Robot) -> str:
    """Logs, reads and simulates a trial of an adapted robot, and returns the outcome."""
    out = Path("trial.mcap")
    plan = plan_of(robot, STEPS)
    write_trial(out, robot, plan, made_up(robot, STEPS), TrialHeader(SETTINGS))
    log = verify(out).log
    again = robot_of(read_log(out))
    out.unlink()
    if again.anatomy != robot.anatomy:
        raise AssertionError("the robot of the log is another robot")
    outcome = Simulator(again, 1).run([(INTACT, log.trial.plan.controller)], STEPS, ("sensors",))
    return "diverged" if outcome.diverged[0] else "simulated"


TARGET = Target("mjcf", 10, prepare)
