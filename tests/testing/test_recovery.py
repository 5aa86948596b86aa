"""Promises of the checks of a recovery's plug-ins: each broken rule is found and told."""

import dataclasses
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

import selfmodel
from selfmodel import plugins
from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, ControllerBatch
from selfmodel.controllers.network import Network
from selfmodel.recovery import DISPLACEMENT, RecoveryLoop, Score
from selfmodel.recovery.cma_es import CmaEs
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from tests.helpers.command import selfmodel as command

COUNTED = iter(range(1000))


def score(of: Callable[..., object], **changes: object) -> Score:
    return dataclasses.replace(DISPLACEMENT, of=of, name="mine", **changes)


def zeroed(robot: Robot, hypothesis: object, trajectory: object) -> FloatArray:
    """The displacement, after which the rollouts have another one."""
    found = DISPLACEMENT.of(robot, hypothesis, trajectory)
    trajectory["base_position"][:] = 0.0
    return found


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        (score(lambda *given: DISPLACEMENT.of(*given) - DISPLACEMENT.of(*given).mean()), "depend"),
        (score(lambda *given: DISPLACEMENT.of(*given) + next(COUNTED)), "the same rollouts"),
        (score(zeroed), "the same rollouts|must not change"),
        (score(lambda *_: 3.0), "one number for each of 3 runs"),
        (score(DISPLACEMENT.of, record=("base",)), "tuple of one or more of"),
        (dataclasses.replace(DISPLACEMENT, name=" "), "needs a name"),
        ("displacemnt", "unknown score"),
        (3, "expected a selfmodel.recovery.Score, got 3"),
    ],
)
def test_a_score_that_breaks_a_rule_is_told_which(wrong: object, rule: str):
    with pytest.raises(ValueError, match=rule):
        selfmodel.check_score(wrong)


def first(loop: RecoveryLoop) -> Controller:
    return loop.controllers[0]


def drawn(loop: RecoveryLoop, rng: np.random.Generator) -> Controller:
    return Controller(first(loop).design, rng.uniform(-1, 1, len(first(loop).genome)))


def forgetful(loop: RecoveryLoop) -> Controller:
    loop.trials = loop.trials[-1:]
    return first(loop)


FOREIGN, ALIEN = np.random.default_rng(), Network(("a",), ("b",), 3)
"""Random numbers of nobody's seed, and the controllers of another robot."""


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        (lambda loop: first(loop).genome, "must return a Controller, got array"),
        (lambda loop: drawn(loop, FOREIGN), "draw random numbers from loop.rng"),
        (
            lambda _: Controller(ALIEN, np.zeros(19)),
            "next trial has a controller for the sensors a",
        ),
        (forgetful, "must not change the trials"),
        (lambda: None, "a function of the arguments loop"),
    ],
)
def test_a_next_trial_that_breaks_a_rule_is_told_which(wrong: object, rule: str):
    with pytest.raises(ValueError, match=rule):
        selfmodel.check_next_trial(wrong)


def test_a_next_trial_that_draws_from_the_loop_keeps_the_rules():
    selfmodel.check_next_trial(lambda loop: drawn(loop, loop.rng))


@dataclasses.dataclass(frozen=True)
class Strange(Network):
    """A network whose commands are those that ``change`` makes of it."""

    change: Callable[[FloatArray], object] = dataclasses.field(kw_only=True)

    def batch(self, genomes: FloatArray, silent: Sequence[set[int]]) -> ControllerBatch:
        """Returns the network's batch, which steps otherwise."""
        batch = super().batch(genomes, silent)
        change, step = self.change, batch.step
        batch.step = lambda targets: (step(targets), change(targets))
        return batch


def strange(change: Callable[[FloatArray], object]) -> Callable[[Robot, int | None], Strange]:
    def make(robot: Robot, hidden: int | None) -> Strange:
        own = network_for(robot, hidden)
        return Strange(own.sensors, own.motors, own.hidden, ranges=own.ranges, change=change)

    return make


def filled(commands: FloatArray) -> None:
    commands[:] = 3.0


def by_batch(commands: FloatArray) -> None:
    commands *= 1 / len(commands)


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        (strange(filled), "commands must be finite and in the range of their motor"),
        (strange(by_batch), "the commands of run 0 must not depend on the other runs"),
        (lambda robot, _: network_for(robot, next(COUNTED) % 90 + 2), "must be equal"),
        (strange(len), "a log must give the same controller of network again"),
        (ALIEN, "the design has a controller for the sensors a"),
        (lambda _robot, _hidden: "network", "a function that returns a Design"),
    ],
)
def test_a_design_that_breaks_a_rule_is_told_which(wrong: object, rule: str):
    with pytest.raises(ValueError, match=rule):
        selfmodel.check_design(wrong)


def search(**methods: object) -> type[CmaEs]:
    """CMA-ES with other methods."""
    return type("Search", (CmaEs,), methods)


def lazy(self: CmaEs, fitness: FloatArray) -> None:
    CmaEs.tell(self, fitness)
    self.evaluations = 1


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        (search(ask=lambda self: self._rng.uniform(-1, 1, (4, 5))), "the same until tell"),
        (search(ask=lambda self: 3 * CmaEs.ask(self)), r"values in \[-1, 1\]"),
        (search(tell=lazy), "evaluations must be"),
        (lambda length, settings, rng, _: CmaEs(length, settings, rng), "have the initial genomes"),
        (
            lambda length, settings, _, seeds: CmaEs(length, settings, FOREIGN, seeds),
            "draw random numbers from rng",
        ),
    ],
)
def test_a_search_that_breaks_a_rule_is_told_which(wrong: object, rule: str):
    with pytest.raises(ValueError, match=rule):
        selfmodel.check_search(wrong)


@pytest.mark.parametrize("name", plugins.SEARCHES)
def test_the_searches_keep_the_rules(name: str):
    selfmodel.check_search(name)


PLUG_INS = """
import dataclasses
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.recovery import DISPLACEMENT

MINE = dataclasses.replace(DISPLACEMENT, name="mine")
WRONG = dataclasses.replace(MINE, of=lambda *_: 1.0)
RAISES = dataclasses.replace(MINE, of=lambda *_: 1 // 0)
"""


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (
            "score checked_plugins:MINE",
            0,
            "score checked_plugins:MINE fulfils its contract:\n  one",
        ),
        ("score checked_plugins:WRONG --json", 1, "error: score checked_plugins:WRONG: .*expected"),
        ("score checked_plugins:RAISES", 1, "raised ZeroDivisionError: .*: correct it where"),
        ("kind break --robot hexapod", 0, "kind break fulfils"),
        ("search cma-es --robot hexapod", 2, "error: --robot is for kind, score, controller"),
        ("scor mine", 2, "unknown sort of plug-in 'scor': did you mean score"),
    ],
)
def test_the_command_checks_a_plug_in(tmp_path: Path, words: str, status: int, told: str):
    (tmp_path / "checked_plugins.py").write_text(PLUG_INS)
    done = command("check", *words.split(), cwd=tmp_path)

    assert done.returncode == status
    assert (status == 0) == bool(done.stdout)
    assert re.search(told, done.stdout + done.stderr)
