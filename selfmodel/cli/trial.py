"""``selfmodel trial``: runs and logs one physical trial."""

import json
from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.options import (
    Damage,
    GapLevel,
    Json,
    ModelSettings,
    NamedKinds,
    Neurons,
    RobotName,
    Seed,
    StageName,
    Structural,
    check_log_name,
)


def trial(
    robot: RobotName,
    *,
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="FILE.mcap", help="The log to write; it must not exist."
        ),
    ],
    damage: Damage = None,
    kinds: NamedKinds = "all",
    model_settings: ModelSettings = None,
    controller: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.npz|LOG.mcap|network|cpg",
            help="Whose controller drives the robot, or the kind of a random one from the seed.",
            show_default="network",
        ),
    ] = None,
    neurons: Neurons = None,
    gap: GapLevel = 0.0,
    structure: Structural = False,
    stage: StageName = "single",
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Run one trial of the simulated physical robot and write its log."""
    # Whatever brings MuJoCo waits until the command runs.
    import numpy as np  # noqa: PLC0415

    from selfmodel.cli import inputs  # noqa: PLC0415
    from selfmodel.controllers.controller import (  # noqa: PLC0415
        Controller,
        check_silent_neurons,
        draw_genomes,
    )
    from selfmodel.experiments import plugins, robots, trial_logs  # noqa: PLC0415
    from selfmodel.experiments.reality import draw_reality  # noqa: PLC0415
    from selfmodel.faults.neuron import silent_neurons  # noqa: PLC0415
    from selfmodel.faults.notation import parse  # noqa: PLC0415
    from selfmodel.faults.registry import known  # noqa: PLC0415
    from selfmodel.logs.physical_trial import run_trial  # noqa: PLC0415
    from selfmodel.logs.records import TrialHeader  # noqa: PLC0415
    from selfmodel.robot.designs import DESIGNS  # noqa: PLC0415
    from selfmodel.settings import Settings  # noqa: PLC0415
    from selfmodel.trials.trial import TrialPlan  # noqa: PLC0415

    kind = "network" if controller is None else str(controller)
    made = robots.robot_entry(robot, model_settings or ()).robot()
    check_log_name(out)
    hidden = parse(
        "intact" if damage is None else damage, made.anatomy, known(plugins.kinds(kinds))
    )
    reality = draw_reality(made, seed, gap, structure=structure)
    if kind in DESIGNS:
        design = plugins.design(kind, made, neurons)
        driver = Controller(design, draw_genomes(np.random.default_rng(seed), (design.weights,)))
    else:
        driver = trial_logs.controller(Path(kind), made, neurons)
    check_silent_neurons(driver.design, silent_neurons(hidden))
    settings = Settings()
    plan = TrialPlan("trial", inputs.stage(stage), driver, settings.steps, seed)
    header = TrialHeader(settings, hidden=str(hidden), gap=reality.text)
    try:
        logged = run_trial(reality.robot(made, hidden), plan, out, made, header)
    except KeyboardInterrupt:
        typer.echo(f"interrupted: the steps so far are in {out}.part", err=True)
        raise typer.Exit(130) from None
    facts = {
        "log": str(out),
        "robot": made.name,
        "truth": str(hidden),
        "gap": gap,
        "structure": structure,
        "seed": seed,
        "steps": logged.behaviour.steps,
        "displacement": logged.displacement,
    }
    if as_json:
        typer.echo(json.dumps(facts, indent=2))
    else:
        typer.echo(f"{made.name} ({hidden}) went {logged.displacement:.3f} m forward: {out}")
