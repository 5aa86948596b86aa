"""Contract tests of every kind of fault and of environment, parametrised over the registry."""

import dataclasses
import importlib.util
from collections.abc import Callable
from itertools import permutations
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from selfmodel import arguments, plugins
from selfmodel.arguments import kinds_of
from selfmodel.controllers.playback import Playback
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.registry import (
    ALL_KINDS,
    KINDS,
    PAPER_KINDS,
    kind_names,
)
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.testing import check_fault_kind
from tests.helpers.drivers import random_motion
from tests.logs.conftest import MJCF


def example(name: str) -> ModuleType:
    """A module of examples/, imported by path."""
    path = Path(__file__).parents[2] / "examples" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


GRAVITY = example("gravity").GRAVITY


EVERY_KIND = [
    pytest.param(kind, marks=[] if kind.searchable else pytest.mark.search, id=kind.name)
    for kind in (*KINDS.values(), GRAVITY)
]


@pytest.mark.parametrize("kind", EVERY_KIND)
def test_a_kind_keeps_its_contract(kind: FaultKind):
    # Its joints have several hinges.
    check_fault_kind(kind, Robot("biped", MJCF, 0.01))


def test_the_registry_knows_each_kind_by_its_name():
    assert all(KINDS[name].name == name for name in KINDS)
    assert [kind.name for kind in PAPER_KINDS] == ["break", "jam", "sensor"]
    assert set(KINDS.values()) - set(ALL_KINDS) == {KINDS["neuron"]}


def test_what_a_joint_absorbs_would_not_move_the_robot(quadruped: Robot):
    """Checks that the pair of faults moves like its canonical form."""
    anatomy = quadruped.anatomy
    driver = Playback(anatomy.motors, random_motion(quadruped, 60))
    first = anatomy.joints[0]
    faults = [
        fault
        for kind in ALL_KINDS
        for fault in {fault.part: fault for fault in kind.candidates(anatomy)}.values()
        if fault.part in (first.name, *first.descendants)
    ]
    absorbed = [
        (one, other)
        for one, other in permutations(faults, 2)
        if one.kind.absorbs(one, other, anatomy)
        # The two faults contradict each other, and the canonical form keeps one.
        and (one.kind.name, other.kind.name) != ("jam", "jam-angle")
    ]
    names = {one.kind.name for one, _ in absorbed}
    assert names == {"break", "jam", "jam-angle", "motor-off", "sensor"}
    runs = [
        (Hypothesis(tuple(sorted(said))), driver) for pair in absorbed for said in (pair, pair[:1])
    ]
    path = Simulator(quadruped, 2).run(runs, 60, ["base_position"]).trajectory["base_position"]

    for pair, said, meant in zip(absorbed, path[::2], path[1::2], strict=True):
        np.testing.assert_allclose(said, meant, atol=1e-9, rtol=0, err_msg=str(pair))


GRADED = dataclasses.replace(GRAVITY, name="odd", keyword="odd", bounds=(0, 2), levels=(1.0,))
CALLS = iter(range(1, 1000))


def with_methods(**methods: Callable[..., object]) -> FaultKind:
    """``GRADED`` with other methods, which are functions without ``self``."""
    own = {name: staticmethod(method) for name, method in methods.items()}
    fields = {f.name: getattr(GRADED, f.name) for f in dataclasses.fields(GRADED)}
    return type("Odd", (type(GRADED),), own)(**fields)


def heavier_each_time(variant: ModelVariant, _anatomy: Anatomy, _fault: Fault) -> None:
    """Edits the model differently at each call."""
    variant.model.body_mass[1] += next(CALLS)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (dataclasses.replace(GRADED, name="two words"), "needs a name without spaces"),
        (dataclasses.replace(GRADED, keyword="a:b"), "needs a keyword without spaces"),
        (with_methods(parts=lambda _anatomy: ()), "nothing can be proposed"),
        (dataclasses.replace(GRADED, levels=()), "nothing can be proposed"),
        (dataclasses.replace(GRADED, levels=(3.0,)), "not between 0 and 2"),
        (dataclasses.replace(GRADED, bounds=None), "its kind has no bounds"),
        (dataclasses.replace(GRADED, degenerates_to={1.0: None}), "its canonical form is intact"),
        (dataclasses.replace(GRADED, keyword="friction"), "is parsed as friction=1.0"),
        (dataclasses.replace(GRADED, words="worn by {wear}"), "expected words of .*'wear'"),
        (
            dataclasses.replace(with_methods(parts=lambda _anatomy: ("a", "b")), words="worn"),
            "the same at two parts",
        ),
        (with_methods(absorbs=lambda _fault, _other, _anatomy: True), "absorbs itself"),
        (with_methods(apply=lambda *_: None), "changes nothing about a robot"),
        (with_methods(apply=heavier_each_time), "does not make the same robot every time"),
        (
            with_methods(adapt_to_contacts=lambda _own, _fault, points: points.fill(0)),
            "changes the contact points",
        ),
        (
            with_methods(contradicted=lambda _, log: log["sensors"][:, 0] == log["sensors"][:, 0]),
            "the log of a robot with .* contradicts the fault",
        ),
        (with_methods(contradicted=lambda _fault, _log: np.zeros(3)), "a mask of the 20 steps"),
    ],
)
def test_the_contract_kit_sees_each_way_to_break_it(kind: FaultKind, said: str, quadruped: Robot):
    check_fault_kind(GRADED, quadruped)

    with pytest.raises((ValueError, InputError), match=said):
        check_fault_kind(kind, quadruped)


def test_a_fault_of_a_kind_without_words_is_named_by_its_notation():
    kind = dataclasses.replace(GRADED, words="")

    assert Fault(kind, "leg{0}", 1.0).words.endswith("odd:leg{0}=1.0")


def test_the_contract_kit_sees_a_kind_that_edits_the_robot_itself():
    robot = arguments.robot_entry("quadruped").robot()

    def wrong(_variant: ModelVariant, _anatomy: Anatomy, _fault: Fault) -> None:
        robot.model.body_mass[1] = 5.0

    with pytest.raises(ValueError, match=r"does not make the same robot|changes the robot itself"):
        check_fault_kind(with_methods(apply=wrong), robot)


def test_kinds_are_chosen_by_name(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples"))

    assert plugins.kinds("break,jam,sensor") == PAPER_KINDS
    assert plugins.kinds("all") == ALL_KINDS
    assert plugins.kinds(" friction , break") == (KINDS["friction"], KINDS["break"])
    assert plugins.kinds("jam,all") == (KINDS["jam"], *(k for k in ALL_KINDS if k.name != "jam"))
    assert [kind.name for kind in plugins.kinds("jam,gravity:GRAVITY")] == ["jam", "gravity"]


def test_a_set_of_kinds_has_a_name_that_mixes_with_single_kinds():
    paper = ("break", "jam", "sensor")

    assert names_of("paper") == paper
    assert names_of("paper,motor") == (*paper, "motor")
    assert names_of("motor,paper,break") == ("motor", *paper)
    assert names_of("default") == names_of("body,servo-gain,motor-off,environment")
    assert {"jam-angle", "motor"} <= set(names_of("body")) - set(names_of("environment"))
    assert {"friction", "slope", "wind"} <= set(names_of("environment"))
    assert set(names_of("default")) < set(names_of("all"))
    assert kinds_of("paper") == kinds_of(["paper"]) == PAPER_KINDS
    assert kind_names(" paper , motor,brake") == "break,jam,sensor,motor,brake"


def names_of(names: str) -> tuple[str, ...]:
    """The names of the kinds that a text names."""
    return tuple(kind.name for kind in plugins.kinds(names))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("brake", "unknown kind 'brake': did you mean break"),
        ("papr", "unknown kind 'papr': did you mean paper"),
        ("brake", "load, servo-gain, motor-off, leg, paper, body, environment, default, all$"),
        ("", "unknown kind ''"),
        ("break,", "unknown kind ''"),
        ("neuron", "unknown kind 'neuron'"),
        ("nowhere:KIND", "cannot find the kind 'nowhere:KIND'"),
        ("selfmodel.faults:FaultKind", "is no kind: expected a selfmodel.faults.FaultKind"),
        (
            "tests.faults.test_kinds:SECOND_WIND",
            "have the name 'second-wind', or 'wind' in notation",
        ),
        ("tests.faults.test_kinds:OTHER_JAM", "have the name 'jam', or 'cling' in notation"),
    ],
)
def test_a_name_of_no_kind_says_what_was_meant(names: str, said: str):
    with pytest.raises(InputError, match=said):
        plugins.kinds(names)


SECOND_WIND = dataclasses.replace(GRADED, name="second-wind", keyword="wind")
OTHER_JAM = dataclasses.replace(GRADED, name="jam", keyword="cling")
