"""``selfmodel repertoire make``: a repertoire of gaits of a healthy robot, by MAP-Elites."""

from pathlib import Path
from typing import Annotated

import typer

from selfmodel import arguments, plugins
from selfmodel.cli.arguments.inputs import check_folder
from selfmodel.cli.arguments.options import (
    SEARCH,
    ControllerKind,
    Json,
    ModelSettings,
    Neurons,
    RobotName,
    Seed,
    Steps,
    Threads,
)
from selfmodel.cli.output.printing import print_json, print_notes
from selfmodel.cli.repertoire.info import facts_of, print_facts
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.repertoires import save_repertoire
from selfmodel.recovery.map_elites import (
    EVALUATIONS,
    Filling,
    make_repertoire,
    simulated_evaluation,
)
from selfmodel.simulation.simulator import Simulator

NOTES = 10
"""Number of lines of progress."""


def make(
    robot: RobotName,
    *,
    out: Annotated[
        Path,
        typer.Option(*("--out", "-o"), metavar="NEW.npz", help="File to write; must not exist."),
    ],
    model_settings: ModelSettings = None,
    controller: ControllerKind = "network",
    neurons: Neurons = None,
    evaluations: Annotated[
        int,
        typer.Option(
            min=1, max=10**8, metavar="N", help="Gaits to evaluate.", rich_help_panel=SEARCH
        ),
    ] = EVALUATIONS,
    levels: Annotated[
        int | None,
        typer.Option(
            min=2,
            max=1000,
            metavar="N",
            help="Cells along each axis, the duty factor of a foot.",
            show_default="20 for four feet, 5 for six",
            rich_help_panel=SEARCH,
        ),
    ] = None,
    steps: Steps = 1000,
    seed: Seed = 0,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Search for gaits with diverse duty factors of the feet, and keep the best of each cell.

    Gaits that fall or do not move forward are left out.
    """
    if out.suffix.lower() != ".npz":
        raise InputError(f"--out needs a name that ends in .npz, got {str(out)!r}")
    check_folder(out)
    refuse_existing(out)
    made = arguments.robot_entry(robot, model_settings or ()).robot()
    simulator = Simulator(made, threads)
    repertoire = make_repertoire(
        made,
        plugins.design(controller, made, neurons),
        simulated_evaluation(simulator, INTACT, steps),
        steps=steps,
        seed=seed,
        evaluations=evaluations,
        levels=levels,
        on_filling=_Notes(),
    )
    save_repertoire(out, repertoire)
    facts = {**facts_of(out, repertoire), "simulated_steps": simulator.stats.steps}
    if as_json:
        print_json(facts)
    else:
        print_facts(facts)


class _Notes:
    """Prints a line of progress after each part of the evaluations."""

    def __init__(self) -> None:
        self._printed = 0

    def __call__(self, filling: Filling) -> None:
        part = filling.evaluations * NOTES // filling.total
        if part > self._printed:
            self._printed = part
            print_notes(
                f"{filling.evaluations} of {filling.total} gaits evaluated, {filling.gaits} kept, "
                f"best {filling.best:.2f} m, {filling.seconds:.0f} s"
            )
