"""Plug-ins by name: entry points of installed packages, and ``package.module:object``."""

from pathlib import Path

import pytest

from selfmodel import plugins
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import Entry
from tests.helpers.drivers import random_controllers

MODULE = """
from dataclasses import replace
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.faults import KINDS

MINE = replace(FORWARD_DISPLACEMENT, name="mine")
LIMP = replace(KINDS["jam"], name="limp", keyword="limp")
NUMBER = 7

def choice(loop):
    return loop.controllers[0]
"""

ENTRY_POINTS = """
[selfmodel.comparators]
displacement-of-theirs = entry_module:MINE
forward-displacement = entry_module:MINE
number = entry_module:NUMBER
gone = entry_module:GONE

[selfmodel.fault_kinds]
limp = entry_module:LIMP

[selfmodel.next_trials]
theirs = entry_module:choice
"""


def install(folder: Path, package: str, entry_points: str) -> None:
    """Writes the metadata of an installed package."""
    metadata = folder / f"{package}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(entry_points)


@pytest.fixture(autouse=True)
def _installed_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "entry_module.py").write_text(MODULE)
    install(tmp_path, "theirs", ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)


def test_a_comparator_and_a_fault_kind_are_found_by_their_entry_points():
    assert plugins.comparator("displacement-of-theirs").name == "mine"
    assert [kind.name for kind in plugins.kinds("break,limp")] == ["break", "limp"]


def test_a_choice_of_the_next_trial_is_found_by_its_entry_point_whose_module_is_that_of_a_study():
    assert plugins.next_trial("theirs").__name__ == "choice"
    given = {"next_trial": "theirs", "kinds": "jam,limp", "score": "energy", "seed": 3}
    assert plugins.modules_of(given) == ("entry_module",)
    assert plugins.modules_of({**given, "next_trial": "bank", "kinds": "jam"}) == ()


def test_an_object_that_a_package_imports_from_its_module_has_the_name_of_the_module(
    tmp_path: Path,
):
    (tmp_path / "outer").mkdir()
    (tmp_path / "outer" / "__init__.py").write_text("from outer.inner import MINE\n")
    (tmp_path / "outer" / "inner.py").write_text(MODULE)
    found = plugins.comparator("outer:MINE")

    assert plugins.comparator_names([found, FORWARD_DISPLACEMENT]) == (
        "outer.inner:MINE",
        "forward-displacement",
    )


def test_a_name_of_selfmodel_has_precedence_over_an_entry_point():
    assert plugins.comparator("forward-displacement") is FORWARD_DISPLACEMENT


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("displacement-of-their", "did you mean .*displacement-of-theirs"),
        ("number", "'number' is no comparator"),
        ("gone", "cannot find the comparator 'gone': .*GONE.*displacement-of-theirs"),
    ],
)
def test_a_comparator_that_cannot_be_used_is_refused(name: str, reason: str):
    with pytest.raises(InputError, match=reason):
        plugins.comparator(name)


def test_an_unknown_fault_kind_is_refused_with_the_installed_names():
    with pytest.raises(InputError, match=r"unknown kind 'limb': did you mean .*limp"):
        plugins.kinds("limb")


def test_a_name_that_two_packages_define_is_refused(tmp_path: Path):
    install(tmp_path, "others", "[selfmodel.comparators]\nnumber = entry_module:MINE\n")

    with pytest.raises(InputError, match="two installed packages have the comparator 'number'"):
        plugins.comparator("number")


def test_a_plug_in_of_version_0_1_is_refused_with_the_place_of_the_new_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "old_plug_in.py").write_text("from selfmodel.trajectory import Trajectory\n")
    monkeypatch.syspath_prepend(str(tmp_path))

    with pytest.raises(InputError, match=r"written for selfmodel 0\.1, whose modules have moved"):
        plugins.comparator("old_plug_in:OBJECT")


def test_a_score_of_a_plug_in_is_checked_by_the_name_that_was_given(
    tmp_path: Path, quadruped: Robot
):
    text = """
from dataclasses import replace
from selfmodel.recovery import DISPLACEMENT
MINE = replace(DISPLACEMENT, name="mine", of=lambda *_: [float("nan")])
WRONG = replace(DISPLACEMENT, record=("base_pos",))
"""
    (tmp_path / "score_module.py").write_text(text)
    entry = Entry(robot=lambda: quadruped)
    found = plugins.score("score_module:MINE", "quadruped", entry)
    runs = [(INTACT, driver) for driver in random_controllers(quadruped, 1)]
    run = Simulator(quadruped, 1).run(runs, 3, found.record)

    with pytest.raises(InputError, match="score 'score_module:MINE': expected one number"):
        found.of(quadruped, INTACT, run.trajectory)
    with pytest.raises(InputError, match="score 'score_module:WRONG' has record="):
        plugins.score("score_module:WRONG", "quadruped", entry)


@pytest.mark.parametrize(
    ("name", "needs"),
    [("tracking", r"recovery\.tracking\(reference, robot\)"), ("velocity", "--controller policy")],
)
def test_a_score_that_needs_more_than_its_name_is_refused_with_what_it_needs(
    name: str, needs: str, quadruped: Robot
):
    entry = Entry(robot=lambda: quadruped)
    with pytest.raises(InputError, match=f"^the score {name} follows .*{needs}"):
        plugins.score(name, "quadruped", entry)
    with pytest.raises(InputError, match="the search repertoire needs gaits"):
        plugins.search("repertoire")
