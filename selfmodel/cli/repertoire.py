"""``selfmodel repertoire``: files with many diverse gaits of one robot."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from selfmodel import arguments, plugins
from selfmodel.cli.commands import MakeRepertoire, RepertoireInfo
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
    _print(
        {**_facts(options.out, repertoire), "simulated_steps": simulator.stats.steps},
        as_json=options.as_json,
    )


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
    _print(_facts(options.file, load_repertoire(options.file)), as_json=options.as_json)


def _facts(path: Path, repertoire: Repertoire) -> dict[str, Any]:
    feet = repertoire.descriptors.shape[1]
    return {
        "repertoire": str(path),
        **dataclasses.asdict(repertoire.origin),
        "controller": repertoire.design.name,
        "gaits": len(repertoire),
        "feet": feet,
        "cells": repertoire.origin.levels**feet,
        "best": float(repertoire.scores[0]),
        "median": float(np.median(repertoire.scores)),
    }


def _print(facts: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print_json(facts)
        return
    print_lines(
        f"{facts['repertoire']}: {facts['gaits']} gaits of {facts['robot']}, one per cell of duty "
        f"factors ({facts['feet']} feet, {facts['levels']} levels each)",
        f"score of a gait in {facts['steps']} steps, m: best {facts['best']:.2f}, median "
        f"{facts['median']:.2f}",
        f"made from {facts['evaluations']} evaluations of a {facts['controller']} with seed "
        f"{facts['seed']} by selfmodel {facts['version']}; model {facts['model'][:12]}",
    )
