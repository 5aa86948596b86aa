"""Folders of recoveries: diagnoses and results as JSON, beside the logs of their trials."""

from functools import partial
from pathlib import Path

import numpy as np

from selfmodel.cli.rendering.diagnosed import diagnosed
from selfmodel.experiments.robots import robot_entry
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.logs.journal import DIAGNOSES, TRIALS, FolderJournal
from selfmodel.robot.anatomy import Anatomy
from tests.fuzz.mutate import data as raw, jsons
from tests.fuzz.seeds import DATA
from tests.fuzz.target import Case, Make, Target

LOG = f"{TRIALS}/00-before.mcap"


def prepare(folder: Path) -> Make:  # noqa: ARG001  # its seeds are in the repository
    """Returns the maker of folders."""
    run = DATA / "recovery"
    diagnoses, result = (run / DIAGNOSES).read_bytes(), (run / "result.json").read_bytes()
    log = (run / LOG).read_bytes()
    anatomy = robot_entry("quadruped").robot().anatomy

    def make(rng: np.random.Generator) -> Case:
        kind = rng.random()
        if kind < 0.2:
            data, what = jsons.mutated(result, rng)
            return Case(f"result {what}", {"result.json": data}, _check_result)
        data, what = jsons.mutated(diagnoses, rng)
        files = {DIAGNOSES: data, f"{TRIALS}/.keep": b""}
        if kind < 0.3:
            damaged, damage = raw.mutated(log, rng) if kind < 0.25 else (log, "whole")
            files, what = {**files, LOG: damaged}, f"{what}; log {damage}"
        return Case(f"diagnoses {what}", files, partial(_check, anatomy))

    return make


def _check_result() -> str:
    return "read" if diagnosed(Path("result.json")) else "empty"


def _check(anatomy: Anatomy) -> str:
    journal = FolderJournal(Path(), HypothesisSpace(anatomy, ()))
    found = journal.read()
    for diagnosis in found.diagnoses:
        # The text and the JSON of a diagnosis that was read, and the seeds that it gives.
        if not str(diagnosis) or not diagnosis.to_dict():
            raise AssertionError("a diagnosis is empty")
    if found.diagnoses:
        before = (Path() / DIAGNOSES).read_bytes()
        journal.add(found.diagnoses[-1])
        again = journal.read().diagnoses
        (Path() / DIAGNOSES).write_bytes(before)
        if again != (*found.diagnoses, found.diagnoses[-1]):
            raise AssertionError("it is written and read as another diagnosis")
    return f"read {len(found.hypotheses) > 0}"


TARGET = Target("journals", 4, prepare)
