"""Promises of the plan: wrong input is refused before anything is run, and runs are resumable."""

from pathlib import Path

import numpy as np
import pytest

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.controllers.controller import Controller, draw_genomes
from selfmodel.errors import InputError
from selfmodel.experiments.gaits import write_gait
from selfmodel.experiments.paper.plan import (
    COMPARATORS,
    ON_ROBOT,
    PaperStudy,
    check,
    gait_jobs,
    gait_path,
    recovery_jobs,
)
from selfmodel.robot.designs import network_for
from selfmodel.settings import Settings
from selfmodel.tasks import ROBOTS


def test_the_default_is_the_papers_experiment_with_its_comparator_first():
    study = PaperStudy(folder=Path("out"))

    check(study)
    assert (study.robots, study.cases) == (("quadruped", "hexapod"), tuple(range(1, 11)))
    assert study.settings == Settings()
    assert (study.comparators[0], *COMPARATORS) == (
        FORWARD_DISPLACEMENT.name,
        "forward-displacement",
        "auto",
    )


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"robots": ["quadrped"]}, "unknown robot of the paper 'quadrped': did you mean quadruped"),
        ({"robots": ["suite-walker-walk"]}, "the known ones are quadruped, hexapod"),
        ({"cases": [1, 11]}, "unknown case of Table I '11'"),
        ({"comparators": ["nope"]}, "unknown comparator 'nope'"),
        ({"comparators": [ON_ROBOT]}, "is no comparator"),
    ],
)
def test_wrong_input_is_refused(tmp_path: Path, wrong: dict, message: str):
    with pytest.raises(InputError, match=message):
        check(PaperStudy(folder=tmp_path, **wrong))


def test_each_robot_and_seed_has_one_gait_for_all_cases_and_comparators():
    study = PaperStudy(folder=Path("out"), seeds=range(2))

    assert [job.key for job in gait_jobs(study)] == [
        *("quadruped-seed000", "hexapod-seed000"),
        *("quadruped-seed001", "hexapod-seed001"),
    ]


def test_a_run_has_a_part_for_each_comparator_and_the_control(tmp_path: Path):
    study = PaperStudy(folder=tmp_path, robots=["quadruped"], cases=[1, 10])
    design = network_for(ROBOTS["quadruped"].robot())
    genome = draw_genomes(np.random.default_rng(0), (design.weights,))
    path = gait_path(tmp_path, "quadruped-seed000")
    path.parent.mkdir()
    assert recovery_jobs(study) == []  # no gait, no recovery

    write_gait(path, Controller(design, genome), evaluations=1)
    jobs = recovery_jobs(study)

    assert [job.key for job in jobs] == ["quadruped-case01-seed000", "quadruped-case10-seed000"]
    assert [job.parameters["truth"] for job in jobs] == ["break:front_left_knee", "neuron:0"]
    assert {job.parts for job in jobs} == {("forward-displacement", "auto", ON_ROBOT)}
