"""``selfmodel repertoire``: files with many diverse gaits of one robot."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from selfmodel import arguments, plugins
from selfmodel.cli.commands import MakeRepertoire, RepertoireInfo
from selfmodel.cli.inputs import check_folder
from selfmodel.cli.output.printing import print_json, print_lines, print_notes
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.repertoires import load_repertoire, save_repertoire
from selfmodel.recovery.repertoire import (
    Filling,
    Repertoire,
    make_repertoire,
    simulated_evaluation,
)
from selfmodel.simulation.simulator import Simulator

NOTES = 10
"""Number of lines of progress."""


def make(options: MakeRepertoire) -> None:
    """Search for gaits with diverse duty factors of the feet, and keep the best of each cell."""
    if options.out.suffix.lower() != ".npz":
        raise InputError(f"--out needs a name that ends in .npz, got {str(options.out)!r}")
    check_folder(options.out)
    refuse_existing(options.out)
    made = arguments.robot_entry(options.robot, options.model_settings or ()).robot()
    simulator = Simulator(made, options.threads)
    repertoire = make_repertoire(
        made,
        plugins.design(options.controller, made, options.neurons),
        simulated_evaluation(simulator, INTACT, options.steps),
        steps=options.steps,
        seed=options.seed,
        evaluations=options.evaluations,
        levels=options.levels,
        on_filling=_Notes(),
    )
    save_repertoire(options.out, repertoire)
    facts = {**facts_of(options.out, repertoire), "simulated_steps": simulator.stats.steps}
    if options.as_json:
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


def info(options: RepertoireInfo) -> None:
    """Verify a repertoire file, and show its robot, its gaits and how it was made."""
    facts = facts_of(options.file, load_repertoire(options.file))
    if options.as_json:
        print_json(facts)
    else:
        print_facts(facts)


def facts_of(path: Path, repertoire: Repertoire) -> dict[str, Any]:
    """Returns the facts of a repertoire as JSON."""
    return {
        "repertoire": str(path),
        **dataclasses.asdict(repertoire.origin),
        "controller": repertoire.design.name,
        "gaits": len(repertoire),
        "feet": repertoire.descriptors.shape[1],
        "cells": repertoire.origin.levels ** repertoire.descriptors.shape[1],
        "best": float(repertoire.scores[0]),
        "median": float(np.median(repertoire.scores)),
    }


def print_facts(facts: dict[str, Any]) -> None:
    """Prints the facts of a repertoire."""
    print_lines(
        f"{facts['repertoire']}: {facts['gaits']} gaits of {facts['robot']}, one per cell of duty "
        f"factors ({facts['feet']} feet, {facts['levels']} levels each)",
        f"score of a gait in {facts['steps']} steps, m: best {facts['best']:.2f}, median "
        f"{facts['median']:.2f}",
        f"made from {facts['evaluations']} evaluations of a {facts['controller']} with seed "
        f"{facts['seed']} by selfmodel {facts['version']}; model {facts['model'][:12]}",
    )
