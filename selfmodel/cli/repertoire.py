"""``selfmodel repertoire``: files with many diverse gaits of one robot."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from selfmodel import arguments, plugins
from selfmodel.cli.commands import Command, MakeRepertoire, RepertoireInfo
from selfmodel.cli.inputs import check_new_file
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.repertoires import load_repertoire, save_repertoire
from selfmodel.recovery.map_elites import Filling, make_repertoire, simulated_evaluation
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.simulation.simulator import Simulator

NOTES = 10
"""Number of lines of progress."""


def make(options: MakeRepertoire) -> None:
    """Search for gaits with diverse duty factors of the feet, and keep the best of each cell."""
    check_new_file(options.out, ".npz")
    robot = arguments.robot_entry(options.robot, options.model_settings or ()).robot()
    simulator = Simulator(robot, options.threads)
    repertoire = make_repertoire(
        robot,
        plugins.design(options.controller, robot, options.neurons),
        simulated_evaluation(simulator, INTACT, options.steps),
        steps=options.steps,
        seed=options.seed,
        evaluations=options.evaluations,
        levels=options.levels,
        on_filling=_notes(),
    )
    save_repertoire(options.out, repertoire)
    _print(options.out, repertoire, options, {"simulated_steps": simulator.stats.steps})


def _notes() -> Callable[[Filling], None]:
    """Returns a function that prints a line of progress after each part of the evaluations."""
    printed = 0

    def note(filling: Filling) -> None:
        nonlocal printed
        part = filling.evaluations * NOTES // filling.total
        if part > printed:
            printed = part
            print_notes(
                f"{filling.evaluations} of {filling.total} gaits evaluated, {filling.gaits} kept, "
                f"best {filling.best:.2f} m, {filling.seconds:.0f} s"
            )

    return note


def info(options: RepertoireInfo) -> None:
    """Verify a repertoire file, and show its robot, its gaits and how it was made."""
    _print(options.file, load_repertoire(options.file), options, {})


def _print(path: Path, repertoire: Repertoire, options: Command, more: dict[str, int]) -> None:
    origin, feet, scores = repertoire.origin, repertoire.descriptors.shape[1], repertoire.scores
    best, median = float(scores[0]), float(np.median(scores))
    if options.as_json:
        facts = {
            "repertoire": str(path),
            **dataclasses.asdict(origin),
            "controller": repertoire.design.name,
            "gaits": len(repertoire),
            "feet": feet,
            "cells": origin.levels**feet,
            "best": best,
            "median": median,
        }
        print_json(facts | more)
        return
    print_lines(
        f"{path}: {len(repertoire)} gaits of {origin.robot}, one per cell of duty factors "
        f"({feet} feet, {origin.levels} levels each)",
        f"score of a gait in {origin.steps} steps, m: best {best:.2f}, median {median:.2f}",
        f"made from {origin.evaluations} evaluations of a {repertoire.design.name} with seed "
        f"{origin.seed} by selfmodel {origin.version}; model {origin.model[:12]}",
    )
