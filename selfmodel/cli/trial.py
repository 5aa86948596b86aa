"""``selfmodel trial``: one logged trial of the simulated physical robot."""

from pathlib import Path
from typing import cast

import numpy as np

from selfmodel import arguments, plugins
from selfmodel.arrays import finite_or_none
from selfmodel.cli import inputs
from selfmodel.cli.commands import RunTrial
from selfmodel.cli.output import print_json, print_lines
from selfmodel.controllers.controller import Controller, check_silent_neurons, draw_genomes
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.sensors import silent_neurons
from selfmodel.logs.files import partial_path
from selfmodel.logs.physical_trial import run_trial
from selfmodel.logs.records import TrialHeader
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.falls import fall_of, fall_text
from selfmodel.settings import Settings
from selfmodel.studies.experiment import draw_reality
from selfmodel.trials.trial import Stage, TrialPlan


def trial(options: RunTrial) -> None:
    """Run one trial of the simulated physical robot and write its log."""
    robot = arguments.robot_entry(options.robot, options.model_settings or ()).robot()
    inputs.check_log_name(options.out)
    space = HypothesisSpace(robot.anatomy, plugins.kinds(options.kinds))
    hidden = space.parse("intact" if options.damage is None else options.damage)
    gap = draw_reality(robot, options.seed, options.gap)
    if inputs.is_file(options.controller):
        driver = arguments.read_controller(Path(options.controller), robot, options.neurons)
    else:
        design = plugins.design(options.controller, robot, options.neurons)
        weights = draw_genomes(np.random.default_rng(options.seed), (design.weights,))
        driver = Controller(design, weights)
    check_silent_neurons(driver.design, silent_neurons(hidden))
    settings = Settings(steps=options.steps)
    plan = TrialPlan("trial", cast("Stage", options.stage), driver, settings.steps, options.seed)
    header = TrialHeader(settings, hidden=str(hidden), gap=gap.text)
    try:
        logged = run_trial(SimulatedRobot(robot, hidden, gap), plan, options.out, robot, header)
    except KeyboardInterrupt as interruption:
        if (part := partial_path(options.out)).exists():
            interruption.add_note(f"the steps so far are in {part}")
        raise
    facts = {
        "log": str(options.out),
        "robot": robot.name,
        "truth": str(hidden),
        "gap": options.gap,
        "structure": False,  # readers of 0.1 expect the key
        "seed": options.seed,
        "steps": logged.trajectory.steps,
        "displacement": finite_or_none(logged.displacement),
        "fell_at_step": (fall := fall_of(robot, hidden, logged)),
    }
    if options.as_json:
        print_json(facts)
    else:
        went = f"{robot.name} ({hidden}) went {logged.displacement:.3f} m forward{fall_text(fall)}"
        print_lines(f"{went}: {options.out}")
