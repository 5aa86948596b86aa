"""Promises of what is evolved: one kind of controller in a recovery, whichever was asked for."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from selfmodel.arguments import comparator_choice
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import Controller
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.next_trial import discriminating_controller
from selfmodel.recovery.recover import RecoveryLoop, by_repair
from selfmodel.recovery.repair import RepairSearch
from selfmodel.recovery.result import Recovery
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.parameters import nominal, with_parameters
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from tests.helpers.drivers import random_controllers, random_cpgs
from tests.helpers.memory import MemoryJournal, in_memory

FEW = dataclasses.replace(Settings(generations=2, steps=60, trials=2).scaled(8), kept=4)


def evolved(robot: Robot, kind: str, next_trial: str = "repair") -> Recovery:
    """A small recovery whose self-model was fitted, and written with fewer digits by that."""
    fitted = with_parameters(robot, dataclasses.replace(nominal(robot), friction=1.1))

    def choose(loop: RecoveryLoop) -> Controller:
        if next_trial == "repair":
            return by_repair(loop)
        known = loop.known
        rest = (loop.simulator, loop.settings, loop.rng)
        return discriminating_controller(known.diagnoses[-1], known.controllers, *rest)

    return RecoveryLoop(
        simulator=Simulator(robot, 1),
        choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
        run_trial=in_memory(robot),
        journal=MemoryJournal(),
        settings=FEW,
        seed=0,
        on_event=lambda _event: None,
        design=DESIGNS[kind](robot, None),
        calibrate=lambda _trials: SimpleNamespace(robot=fitted, summary=None),
        next_trial=choose,
        make_repair=RepairSearch,
    ).run(
        SimulatedRobot(robot), SimulatedRobot(robot, parse("break:back_left_knee", robot.anatomy))
    )


@pytest.fixture(scope="module")
def asymmetric(quadruped: Robot) -> Robot:
    """The quadruped, with command ranges of more digits than a model is written with."""
    ours = "-0.7853981633974483 0.7853981633974483"
    mjcf = quadruped.mjcf.replace(ours, "-0.71234567891 0.6543210987")
    return dataclasses.replace(quadruped, mjcf=mjcf)


@pytest.mark.search
@pytest.mark.parametrize("kind", ["network", "cpg"])
@pytest.mark.parametrize("next_trial", ["repair", "disagreement"])
def test_a_recovery_has_one_design_though_a_fitted_model_is_rounded(
    asymmetric: Robot, kind: str, next_trial: str
):
    trials = evolved(asymmetric, kind, next_trial).trials
    designs = {trial.plan.controller.design for trial in trials}

    assert designs == {DESIGNS[kind](asymmetric, None)}
    assert designs != {DESIGNS[kind](with_parameters(asymmetric, nominal(asymmetric)), None)}


def test_commands_stay_in_the_ranges_of_the_motors(asymmetric: Robot):
    for trial in evolved(asymmetric, "cpg").trials:
        commands = trial.behaviour["commands"]
        assert commands.min() >= -0.71234567891 * (1 + 1e-12)
        assert commands.max() <= 0.6543210987 * (1 + 1e-12)


def test_a_search_for_one_kind_does_not_start_from_controllers_of_the_other(quadruped: Robot):
    seeds = [*random_controllers(quadruped, 2), *random_cpgs(quadruped, 2)]
    for kind in ("network", "cpg"):
        design = DESIGNS[kind](quadruped, None)
        search = RepairSearch(Simulator(quadruped, 1), FEW, design)
        rest = None, seeds, np.random.default_rng(0), lambda _generation: None
        assert {one.controller.design for one in search((INTACT,), *rest)} == {design}
