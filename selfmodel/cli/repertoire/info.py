"""``selfmodel repertoire info``: the content of a repertoire file."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from selfmodel.cli.arguments.options import Json
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.logs.repertoires import load_repertoire
from selfmodel.recovery.repertoire import Repertoire


def info(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Repertoire, NAME.npz.")],
    *,
    as_json: Json = False,
) -> None:
    """Verify a repertoire file, and show its robot, its gaits and how it was made."""
    facts = facts_of(file, load_repertoire(file))
    if as_json:
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
