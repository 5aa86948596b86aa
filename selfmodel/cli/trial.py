"""``selfmodel trial``: one logged trial of the simulated physical robot."""

import math
from pathlib import Path

import numpy as np

from selfmodel import arguments, plugins
from selfmodel.cli.arguments import inputs
from selfmodel.cli.arguments.options import (
    ControllerSource,
    Damage,
    GapLevel,
    Json,
    ModelSettings,
    NamedKinds,
    Neurons,
    NewLog,
    RobotName,
    Seed,
    StageName,
    Steps,
)
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.controllers.controller import Controller, check_silent_neurons, draw_genomes
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.sensors import silent_neurons
from selfmodel.logs.files import partial_path
from selfmodel.logs.physical_trial import run_trial
from selfmodel.logs.records import TrialHeader
from selfmodel.robot.designs import DESIGNS
from selfmodel.settings import Settings
from selfmodel.studies.experiment import draw_reality
from selfmodel.trials.trial import TrialPlan


def trial(
    robot: RobotName,
    *,
    out: NewLog,
    damage: Damage = None,
    kinds: NamedKinds = "all",
    model_settings: ModelSettings = None,
    controller: ControllerSource = None,
    neurons: Neurons = None,
    gap: GapLevel = 0.0,
    steps: Steps = 1000,
    stage: StageName = "single",
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Run one trial of the simulated physical robot and write its log."""
    kind = "network" if controller is None else str(controller)
    made = arguments.robot_entry(robot, model_settings or ()).robot()
    inputs.check_log_name(out)
    hidden = HypothesisSpace(made.anatomy, plugins.kinds(kinds)).parse(
        "intact" if damage is None else damage
    )
    reality = draw_reality(made, seed, gap)
    if kind in DESIGNS:
        design = plugins.design(kind, made, neurons)
        driver = Controller(design, draw_genomes(np.random.default_rng(seed), (design.weights,)))
    else:
        driver = arguments.read_controller(Path(kind), made, neurons)
    check_silent_neurons(driver.design, silent_neurons(hidden))
    settings = Settings(steps=steps)
    plan = TrialPlan("trial", inputs.stage(stage), driver, settings.steps, seed)
    header = TrialHeader(settings, hidden=str(hidden), gap=reality.text)
    try:
        logged = run_trial(reality.robot(made, hidden), plan, out, made, header)
    except KeyboardInterrupt as interruption:
        if (part := partial_path(out)).exists():
            interruption.add_note(f"the steps so far are in {part}")
        raise
    facts = {
        "log": str(out),
        "robot": made.name,
        "truth": str(hidden),
        "gap": gap,
        "structure": False,  # readers of 0.1 expect the key
        "seed": seed,
        "steps": logged.behaviour.steps,
        "displacement": logged.displacement if math.isfinite(logged.displacement) else None,
    }
    if as_json:
        print_json(facts)
    else:
        print_lines(f"{made.name} ({hidden}) went {logged.displacement:.3f} m forward: {out}")
