"""Promises of the bank of gaits: a lost gait is named, and its runs are not left out."""

from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.experiments.ablation import bank
from selfmodel.experiments.ablation.plan import Cell
from selfmodel.experiments.grid import Job, PartResult
from selfmodel.experiments.grid.definition import write_definition
from selfmodel.experiments.grid.parts import done, failed, part_bytes, write_part
from selfmodel.settings import Settings

CELL = Cell("quadruped", 1, "break:front_left_knee", 0.0, 5)


def put(folder: Path, number: int, outcome: dict) -> Path:
    """Writes the part of a gait, and the gait if it was evolved; returns its file."""
    job = Job(f"quadruped-{number}", {}, number)
    write_definition(folder / job.key, job.definition)
    write_part(folder / job.key, "gait", part_bytes(job.definition, "gait", outcome))
    gait = folder / f"{job.key}.npz"
    if outcome["status"] == "done":
        gait.write_bytes(b"a gait")
    return gait


def test_a_lost_gait_is_named(tmp_path: Path):
    evolved = done(tmp_path, PartResult({"evaluations": 1}))
    gaits = [put(tmp_path, number, evolved) for number in CELL.gaits(Settings(trials=2))]
    assert len(bank.digests(tmp_path, CELL, Settings(trials=2))) == len(gaits) == 2
    gaits[1].unlink()

    with pytest.raises(InputError, match=r"quadruped-0\.npz is missing, a gait of the study"):
        bank.digests(tmp_path, CELL, Settings(trials=2))


def test_the_runs_of_a_gait_that_failed_are_left_for_the_next_call(tmp_path: Path):
    put(tmp_path, 5, done(tmp_path, PartResult({"evaluations": 1})))
    put(tmp_path, 0, failed("the simulation diverged"))

    assert bank.digests(tmp_path, CELL, Settings(trials=2)) is None
