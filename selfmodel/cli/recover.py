"""``selfmodel recover``: a robot walks, fails, and is brought back."""

from pathlib import Path
from typing import Annotated

import typer

from selfmodel.cli.options import (
    DEFAULT_KINDS,
    Calibrated,
    ComparatorName,
    ControllerKind,
    Damage,
    GapLevel,
    Generations,
    Json,
    KindNames,
    ModelSettings,
    Neurons,
    NextTrialName,
    Population,
    RobotName,
    Seed,
    Structural,
    Threads,
)
from selfmodel.comparators import DEFAULT


def recover(
    robot: RobotName,
    *,
    case: Annotated[
        int | None, typer.Option(metavar="N", help="A failure of the paper's Table I, 1 to 10.")
    ] = None,
    damage: Damage = None,
    model_settings: ModelSettings = None,
    comparator: ComparatorName = DEFAULT.name,
    calibrate: Calibrated = True,
    gap: GapLevel = 0.0,
    structure: Structural = False,
    kinds: KindNames = DEFAULT_KINDS,
    next_trial: NextTrialName = "repair",
    controller: ControllerKind = "network",
    neurons: Neurons = None,
    seed: Seed = 0,
    trials: Annotated[
        int, typer.Option(min=1, max=99, help="Physical trials after the failing one.")
    ] = 3,
    population: Population = 100,
    generations: Generations = 30,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of the run, new or empty.", show_default="a new one in runs"
        ),
    ] = None,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Recover a robot from a failure: diagnose it from logged trials, evolve a controller."""
    # Whatever brings MuJoCo waits until the command runs.
    from selfmodel.cli import inputs  # noqa: PLC0415
    from selfmodel.cli.output.display import display  # noqa: PLC0415
    from selfmodel.cli.output.report import as_object, print_report  # noqa: PLC0415
    from selfmodel.controllers.controller import check_silent_neurons  # noqa: PLC0415
    from selfmodel.experiments import plugins, robots  # noqa: PLC0415
    from selfmodel.experiments.experiment import Experiment, run  # noqa: PLC0415
    from selfmodel.faults.neuron import silent_neurons  # noqa: PLC0415
    from selfmodel.faults.notation import parse  # noqa: PLC0415
    from selfmodel.faults.registry import known  # noqa: PLC0415
    from selfmodel.logs.files import replace_file  # noqa: PLC0415
    from selfmodel.settings import Settings  # noqa: PLC0415
    from selfmodel.simulation.threads import thread_count  # noqa: PLC0415

    entry = robots.robot_entry(robot, model_settings or ())
    considered = plugins.kinds(kinds)
    damaged = inputs.case_notation(entry, case, damage)
    made = entry.robot()
    design = plugins.design(controller, made, neurons)
    truth = parse(damaged, made.anatomy, known(considered))
    check_silent_neurons(design, silent_neurons(truth))
    experiment = Experiment(
        robot=made,
        case=case,
        truth=truth,
        comparator=plugins.comparator(comparator),
        kinds=considered,
        calibrated=calibrate,
        settings=Settings(trials=trials, generations=generations).scaled(population),
        seed=seed,
        threads=thread_count(threads),
        folder=out or _new_folder(made.name),
        gap=gap,
        structure=structure,
        next_trial=plugins.next_trial(next_trial),
        design=design,
        physical=entry.physical,
    )
    try:
        with display() as on_event:
            outcome = run(experiment, on_event)
    except KeyboardInterrupt:
        typer.echo(f"interrupted: the finished trials are in {experiment.folder}", err=True)
        raise typer.Exit(130) from None
    result = as_object(experiment, outcome)
    try:
        replace_file(experiment.folder / "result.json", f"{result}\n".encode())
    finally:  # what was found is said even where the disk is full
        if as_json:
            typer.echo(result)
        else:
            print_report(experiment, outcome)


def _new_folder(robot: str) -> Path:
    """A folder in ``runs/`` that no run has used, whose name tells nothing of what is hidden."""
    from datetime import datetime  # noqa: PLC0415  # with the other work of the command

    return Path("runs") / f"{robot}-{datetime.now().astimezone():%Y%m%d-%H%M%S-%f}"
