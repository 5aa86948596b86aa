"""Row of one recovery."""

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from selfmodel import plugins
from selfmodel.arguments import AUTO, comparator_choice
from selfmodel.experiments.grid import Cell
from selfmodel.experiments.study.gaits import read_gait, write_gait
from selfmodel.experiments.study.planned_robots import planned_entry
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.plugins import DEFAULT_SCORES
from selfmodel.recovery.random_streams import repair_stream
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies.experiment import Experiment, run

SCORES = {score.name: score for score in (UPRIGHT, DISPLACEMENT)}


def recovered(cell: Cell, needs: Mapping[str, Path], folder: Path) -> dict[str, Any]:
    """Returns the row of a recovery: diagnosis, predicted and observed upright displacement, m.

    Steps and seconds are without the search for the gait before the failure, which the recoveries
    of a robot and seed share.
    """
    parameters, repair = cell.parameters, cell.parameters["repair"]
    robot = planned_entry(parameters).robot()
    experiment = Experiment(
        robot=robot,
        case=parameters["case"],
        truth=parse(parameters["truth"], robot.anatomy),
        choose_comparator=comparator_choice(AUTO),
        settings=Settings(**parameters["settings"]),
        seed=cell.seed,
        threads=1,
        folder=folder / "recovery",
        gap=parameters["gap"],
        score=SCORES[DEFAULT_SCORES[repair]],
        repair=repair,
        gait=read_gait(needs["gait"], robot),
    )
    outcome = run(experiment, lambda _event: None)
    recovery = outcome.recovery
    upright = [
        UPRIGHT.of_trial(robot, faults, trial)
        for faults, trial in zip(recovery.tried, recovery.trials, strict=True)
    ]
    number = partial(round, ndigits=4)
    return {
        **{name: parameters[name] for name in ("robot", "case", "gap")},
        "seed": cell.seed,
        "repair": repair,
        "correct": outcome.correct,
        "diagnosis": str(recovery.diagnosis.best),
        "verdict": recovery.diagnosis.verdict,
        "predicted": [
            number(value) if math.isfinite(value) else None for value in recovery.predicted
        ],
        "upright": [number(value) for value in upright],
        "displacement": [number(trial.displacement) for trial in recovery.trials],
        "falls": list(recovery.falls),
        "simulated_steps": outcome.stats.steps,
        "seconds": number(outcome.seconds),
    }


def make_gait(cell: Cell, _needs: Mapping[str, Path], folder: Path) -> dict[str, Any]:
    """Writes the gait before the failure that a recovery of the robot and seed would evolve."""
    parameters, repair = cell.parameters, cell.parameters["repair"]
    robot = planned_entry(parameters).robot()
    simulator = Simulator(robot, threads=1)
    search = plugins.repair(repair)(
        simulator,
        Settings(**parameters["settings"]),
        network_for(robot),
        SCORES[DEFAULT_SCORES[repair]],
    )
    found = search(
        (INTACT,),
        partial(assumed_uncertainty, robot),
        (),
        repair_stream(cell.seed, 0),
        lambda _generation: None,
    )
    write_gait(folder, found[0].controller)
    return {"simulated_steps": simulator.stats.steps}
