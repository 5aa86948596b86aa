"""Promises of what is made or called in Python: arguments of other types have a sentence."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

import selfmodel
from selfmodel import studies
from selfmodel.comparators import SENSOR_SERIES
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.faults import Fault, FaultKind
from selfmodel.recovery import Score, upright_within
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation import ClosedLoop, Ensemble
from selfmodel.studies.figures import paired_differences
from selfmodel.studies.tables import ablation_results, write_files
from selfmodel.style import figure_style, files_of
from selfmodel.testing import check_comparator
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan


class World(NamedTuple):
    """What the calls need: a robot, a controller of it, and what it records."""

    robot: Robot
    walk: Controller
    trajectory: Trajectory


@pytest.fixture
def world(quadruped: Robot) -> World:
    design = network_for(quadruped)
    walk = Controller(design, np.linspace(-1, 1, design.weights))
    runs = [(selfmodel.Hypothesis(), walk)]
    recorded = selfmodel.Simulator(quadruped, 1).run(runs, 5, ["sensors"]).trajectory
    return World(quadruped, walk, recorded)


class Gravity(FaultKind):
    """A kind of one's own."""

    def __init__(self, **fields: object) -> None:
        super().__init__(**{"name": "gravity", "bounds": (1.0, 20.0), "levels": (3.0,), **fields})


def scored(**fields: object) -> Score:
    return Score(**{"name": "mine", "record": ("sensors",), "of": len, **fields})


def simulated(world: World, **options: object) -> object:
    given = {"runs": [(selfmodel.Hypothesis(), world.walk)], "steps": 5, "record": ["sensors"]}
    return selfmodel.Simulator(world.robot, 1).run(**{**given, **options})


def styled(style: object) -> None:
    with figure_style(style):
        pass


REFUSED: dict[str, tuple[Callable[[World], object], str]] = {
    "a trial to check": (
        lambda w: check_comparator(SENSOR_SERIES, "walk.mcap", w.trajectory),
        r"trial of type Trial or None, got 'walk.mcap': give selfmodel.read_log\(.*\).trial",
    ),
    "a style": (lambda _: styled(3), "the path of column, page, or a style file .* type int"),
    "no style": (lambda _: styled("colum"), "colum: expected column, page, or a style file"),
    "differences": (
        lambda _: paired_differences([1]),
        r"comparisons of type DataFrame, got \[1\]: give selfmodel.load\(",
    ),
    "other rows": (
        lambda _: paired_differences(pd.DataFrame({"a": [1]})),
        r"expected rows of selfmodel.load\(folder\).comparisons\(\), got 1 row of a",
    ),
    "files": (lambda _: write_files("x", 3), "expected files of type Mapping, got 3: give what"),
    "a file as a folder": (lambda _: write_files(__file__, {"a": b""}), "a folder, got a file"),
    "a figure": (lambda _: files_of("x", 3), "expected figure of type Figure, got 3"),
    "results of no study": (lambda _: ablation_results("nofolder"), "the folder of a study, got n"),
    "cells of no folder": (lambda _: list(studies.finished(5)), "the path of a folder of cells"),
    "a name in place of names": (
        lambda _: ClosedLoop(record="joint_positions"),
        r"expected record of type tuple, got 'joint_positions': give what help\(ClosedLoop\)",
    ),
    "a name of an ensemble": (
        lambda _: Ensemble("sensors", 2, 0.05),
        "expected record of type tuple, got 'sensors'",
    ),
    "a keyword": (lambda _: Gravity(keyword=5), "expected keyword of type str, got 5: give what"),
    "a truth of a kind": (lambda _: Gravity(searchable="no"), "searchable of type bool, got 'no'"),
    "bounds": (lambda _: Gravity(bounds=("a", "b")), r"as bounds\[0\], got 'a': give one"),
    "a level": (lambda _: Gravity(levels=("a",)), r"as levels\[0\], got 'a': give one such as"),
    "a base": (lambda _: Gravity(base="fre"), "unknown base of a fault kind 'fre': did you mean f"),
    "an equivalent": (lambda _: Gravity(degenerates_to={1.0: 5}), "a FaultKind, .* got .* int"),
    "a kind of a fault": (lambda _: Fault("jam", "knee"), "kind of type FaultKind, got 'jam'"),
    "faults": (lambda _: selfmodel.Hypothesis("jam:knee"), "faults of type tuple, got 'jam:knee'"),
    "a signal of a score": (
        lambda _: scored(record="base_position"),
        "expected record of type tuple, got 'base_position'",
    ),
    "a unit": (lambda _: scored(unit=5), "expected unit of type str, got 5"),
    "a fitness": (lambda _: scored(of=5), "expected of of type Callable, got 5"),
    "limits": (lambda _: upright_within("x"), "expected max_speed of type float, got 'x'"),
    "a name of a robot to simulate": (
        lambda _: selfmodel.Simulator("quadruped"),
        r"robot of type Robot, got 'quadruped': give selfmodel.load_robot\(",
    ),
    "a name of a robot to control": (
        lambda _: network_for("quadruped"),
        "expected robot of type Robot, got 'quadruped'",
    ),
    "notation to simulate": (
        lambda w: simulated(w, runs=[("intact", w.walk)]),
        r"hypothesis of type Hypothesis, got 'intact': give selfmodel.parse_hypothesis\(",
    ),
    "a file to simulate": (
        lambda w: simulated(w, runs=[(selfmodel.Hypothesis(), "walk.npz")]),
        "expected a Controller or a Playback to drive a robot, got .* str",
    ),
    "nothing to simulate": (lambda w: simulated(w, runs=[]), "pairs .* as runs, got .* NoneType"),
    "no steps": (lambda w: simulated(w, steps=0), "of 1 or above as steps, got 0"),
    "a signal to record": (
        lambda w: simulated(w, record=["base_positon"]),
        "unknown signal 'base_positon': did you mean base_position",
    ),
    "a genome": (
        lambda w: Controller(w.walk.design, [0.0]),
        "genome of type ndarray, got",
    ),
    "a short genome": (lambda w: Controller(w.walk.design, np.zeros(3)), "68 weights, got .*give"),
    "a text as a model": (lambda _: Robot("x", 5, 0.02), "expected mjcf of type str, got 5"),
    "points": (lambda _: selfmodel.Study("x", "x", "m:f", 5), "points of type Mapping, got 5"),
    "a plan": (
        lambda w: Trial(5, "quadruped", w.trajectory, "x"),
        "expected plan of type TrialPlan, got 5",
    ),
    "no name of a trial": (lambda w: TrialPlan(5, "single", w.walk, 5, 0), "name of type str, got"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_argument_of_another_type_is_refused_in_a_sentence(
    name: str, world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    call, sentence = REFUSED[name]

    with pytest.raises(InputError, match=sentence) as refused:
        call(world)
    assert "\n" not in str(refused.value)
    assert not list(tmp_path.iterdir())
