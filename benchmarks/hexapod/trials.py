"""First gaits, walks, diagnoses and recoveries of the hexapod in PyBullet.

It has Bullet's own position motors, and Bullet's own time step.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

import selfmodel
from benchmarks.hexapod.robots import EFFORT, LEGS, STEPS, VELOCITY, retracted, self_model, urdf
from benchmarks.other_engine.bullet import Bullet
from benchmarks.other_engine.client import SUBSTEP, scale, with_faults
from benchmarks.other_engine.environment import BulletEnvironment, physical_robot
from benchmarks.other_engine.reality import Damage, draw_reality
from benchmarks.other_engine.recovery import heading_change, in_mujoco
from benchmarks.rows import kept_gait
from selfmodel import Controller, Diagnosis, EnvironmentRobot, Robot, Settings, Simulator, Trial
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.falls import falls_of
from selfmodel.studies.study import Row

FINER = 4
"""Part of the time step of a self-model at which its predictions are made again."""

TIMESTEP = 1 / 240
"""Bullet's time step, s."""

model_of = cache(self_model)


class HexapodEnvironment(BulletEnvironment):
    """The hexapod of a seed with failed legs, such as ``front_left+back_left``, or ``intact``.

    The gain of its motors is the part of an error that a step of Bullet ends, as far as the effort
    and the largest speed allow. Draws and noise are those of the robots of ``other_engine``.
    """

    def __init__(self, robot: Robot, seed: int, legs: str, gain: float, stream: int = 0) -> None:
        reality, damage = draw_reality(robot, seed), Damage(fixed=retracted(legs))
        reality = replace(reality, delay=round(reality.delay * SUBSTEP / TIMESTEP))
        tree = ET.fromstring(urdf())  # noqa: S314  # our own text
        for link in tree.findall("link"):
            scale(link, reality.masses[robot.model.body(link.get("name")).id])
        faulty = with_faults(tree, damage.lost, damage.fixed)
        bullet = Bullet(robot, reality, damage, faulty, TIMESTEP)
        super().__init__(robot, reality, damage, stream, bullet)
        self._efforts = EFFORT * np.array(reality.torques)
        self._motor = {"positionGain": gain, "velocityGain": 1.0, "maxVelocity": VELOCITY}

    def _drive(self) -> None:
        self._bullet.follow(self._targets, self._efforts, self._motor)


@dataclass(frozen=True)
class Bench:
    """Settings of the searches, and the folder of the first gaits."""

    folder: Path
    settings: Settings
    score: str
    design: str
    repair: str

    def gait(self, key: Row) -> Controller:
        """Returns the first gait of a row: of the folder, or evolved for its self-model."""
        model, seed = key["model"], key["gait"]
        size = f"{self.settings.population}x{self.settings.generations}"
        path = self.folder / f"{model}-{self.design}-{self.score}-{size}-{seed}.npz"
        search = {"design": self.design, "score": self.score, "seed": seed}
        return kept_gait(path, model_of(model), settings=self.settings, **search)


@contextmanager
def physical(key: Row, legs: str, stream: int) -> Iterator[EnvironmentRobot]:
    """Yields the physical robot of a row with some legs failed, or ``intact``."""
    robot = model_of(key["model"])
    with HexapodEnvironment(robot, key["seed"], legs, key["gain"], stream) as environment:
        yield physical_robot(environment, robot)


def logged(key: Row, legs: str, stream: int, gait: Controller, path: Path) -> Trial:
    """Runs and logs a trial, and returns it."""
    with physical(key, legs, stream) as robot:
        return selfmodel.run_trial(robot, gait, path, robot=model_of(key["model"]), steps=STEPS)


def walked(bench: Bench, key: Row, work: Path) -> Row:
    """Returns how far the first gait goes in the self-model, at two time steps, and in PyBullet, m.

    A simulation that diverges goes nowhere.
    """
    gait = bench.gait(key)
    predicted, finer = (
        in_mujoco(Simulator(model_of(key["model"], part), 1), INTACT, gait, STEPS) or 0.0
        for part in (1, FINER)
    )
    trial = logged(key, "intact", 0, gait, work / "intact.mcap")
    return {"predicted": round(predicted, 2), "finer": round(finer, 2), **_walk(key, trial)}


def diagnosed(bench: Bench, key: Row, work: Path) -> Row:
    """Returns the diagnosis of the first gait with failed legs, by a log of the intact robot."""
    gait = bench.gait(key)
    healthy = logged(key, "intact", 0, gait, work / "intact.mcap")
    trial = logged(key, key["legs"], 1, gait, work / "failed.mcap")
    start = time.process_time()
    found = selfmodel.diagnose(
        trial,
        healthy=healthy,
        robot=model_of(key["model"]),
        settings=bench.settings,
        seed=key["seed"],
        threads=1,
    )
    spent = round(time.process_time() - start, 1)
    before = round(healthy.displacement, 2)
    return {"before": before, **_walk(key, trial), **_facts(found, key["legs"]), "spent": spent}


def recovered(bench: Bench, key: Row, work: Path) -> Row:
    """Returns the recovery of a robot with failed legs from its first gait."""
    with physical(key, "intact", 0) as healthy, physical(key, key["legs"], 1) as damaged:
        found = selfmodel.recover(
            healthy,
            damaged,
            model_of(key["model"]),
            work / "run",
            gait=bench.gait(key),
            repair=bench.repair,
            score=bench.score,
            settings=bench.settings,
            seed=key["seed"],
            threads=1,
        )
    before, after, *trials = (_walk(key, trial) for trial in found.trials)
    return {
        **_facts(found.diagnosis, key["legs"]),
        "before": before["walked"],
        "after": after["walked"],
        "trials": trials,
        "predicted": [round(value, 2) for value in found.predicted[2:]],
        "tried": [str(one) for one in found.tried[2:]],
    }


def _walk(key: Row, trial: Trial) -> Row:
    """Returns displacement, m, change of heading, degrees, and whether the robot fell."""
    fall = falls_of(model_of(key["model"]), INTACT, trial.trajectory)
    return {
        "walked": round(trial.displacement, 2),
        "heading": heading_change(trial.trajectory),
        "fell": bool(fall < trial.trajectory.steps),
    }


def _facts(found: Diagnosis, legs: str) -> Row:
    faults = found.best.faults
    named = sorted({leg for leg in LEGS for fault in faults if fault.part.startswith(leg)})
    return {
        "named": "+".join(named),
        "right": set(named) == set(legs.split("+")),
        "kinds": sorted({fault.kind.name for fault in faults}),
        "best": str(found.best),
        "verdict": found.verdict,
        "reason": found.doubt.reason if found.doubt else found.reason,
    }
