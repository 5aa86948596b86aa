"""Promises of policies: what they observe, what they command, and what does not fit."""

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller, Design
from selfmodel.controllers.graph import Graph, Node, State
from selfmodel.controllers.policy import Policy, PolicyBatch, Term
from tests.helpers.policies import (
    INTERFACE,
    MOTORS,
    commanded,
    constant,
    feel,
    policy,
    random_network,
)


def compensated(own: Policy) -> Compensated:
    return Compensated.around(Controller(own, np.empty(0)))


def seen(own: Policy, steps: int, sense: Callable[[PolicyBatch, int], None] = feel) -> list:
    """The rows that the network of one robot receives, by evaluation."""
    batch, rows = own.batch(np.empty((1, 0)), [frozenset()]), []
    network = batch._graph

    def spy(observation: np.ndarray, states: tuple, own: dict) -> tuple:
        rows.append(observation[0].tolist())
        return network.step(observation, states, own)

    batch._graph = SimpleNamespace(step=spy)
    for k in range(steps):
        sense(batch, k)
        batch.step(np.empty((1, len(MOTORS))))
    return rows


TURN = Rotation.from_euler("xyz", (0.4, -0.9, 2.0))


def tilted(batch: PolicyBatch, step: int) -> None:
    """Senses a tilted base, and some numbers that grow with the step."""
    batch.readings[0] = (1.0, 0.25)
    now = {
        "base_orientation": TURN.as_quat(scalar_first=True),
        "base_linear_velocity": (1.0, 2.0, 3.0),
        "base_angular_velocity": (0.1, 0.2, 0.3 + step),
        "joint_positions": (0.5, 99.0, -0.7),
        "joint_velocities": (5.0, 99.0, -7.0 - step),
    }
    for signal in batch.observed:
        batch.observed[signal][0] = now[signal]


@pytest.mark.parametrize(
    ("term", "expected"),
    [
        ("linear_velocity", TURN.inv().apply((1.0, 2.0, 3.0))),
        ("angular_velocity", (0.1, 0.2, 1.3)),
        ("gravity", TURN.inv().apply((0.0, 0.0, -1.0))),
        ("joint_positions", (-0.7 + 0.9, 0.5 - 0.4)),
        ("joint_velocities", (-8.0, 5.0)),
        ("last_action", (1.5, -2.5)),
        ("velocity", (0.5, -0.1, 0.2)),
        ("phase", (math.sin(2 * math.pi * 0.02 / 0.7), math.cos(2 * math.pi * 0.02 / 0.7))),
        ("sensors", (1.0, 0.25)),
    ],
)
def test_a_term_has_its_value_offset_and_scale(term: str, expected: tuple[float, ...]):
    width = len(expected)
    scales, offsets = tuple(np.arange(2.0, 2 + width)), tuple(np.arange(width) - 1.0)
    network = constant(1.5, -2.5, inputs=2 * width)
    own = policy(term, Term(term, scales, offsets), graph=network, period=0.7)
    (_, row) = seen(own, 2, tilted)

    np.testing.assert_allclose(row[:width], expected, atol=1e-12)
    np.testing.assert_allclose(row[width:], (np.array(expected) - offsets) * scales, atol=1e-12)
    assert set(own.batch(np.empty((1, 0)), []).observed) == set(own.observes)


def test_there_is_no_last_action_at_first_and_the_phase_begins_at_zero():
    assert seen(policy("last_action", "phase"), 1) == [[0, 0, 0, 1]]


@pytest.mark.parametrize("by_term", [False, True])
@pytest.mark.parametrize("newest_first", [False, True])
def test_a_history_is_stacked_as_said_and_begins_with_the_first_observation(
    *, by_term: bool, newest_first: bool
):
    terms = ("angular_velocity", "sensors")
    single = seen(policy(*terms), 5)
    stacked = seen(policy(*terms, history=3, by_term=by_term, newest_first=newest_first), 5)
    for k, row in enumerate(stacked):
        last = [single[max(0, k - age)] for age in ((0, 1, 2) if newest_first else (2, 1, 0))]
        parts = [each[:3] for each in last] + [each[3:] for each in last] if by_term else last
        assert row == [number for part in parts for number in part]


def test_a_decimated_network_is_evaluated_every_so_many_steps_and_its_command_is_held():
    own = policy("phase", "sensors", decimation=3)
    commands = commanded(own, steps=7)[:, 0]

    assert seen(own, 7) == seen(policy("phase", "sensors"), 7)[::3]
    assert [k for k in range(1, 7) if (commands[k] != commands[k - 1]).any()] == [3, 6]


def accumulating() -> Graph:
    """A network whose output is the sum of a layer over all evaluations."""
    matrix = np.random.default_rng(2).normal(size=(2, 10))
    nodes = (
        Node("Gemm", ("x", "w"), ("a",), (("transB", 1.0),)),
        Node("Unsqueeze", ("a", "zero"), ("u",)),
        Node("Add", ("h", "u"), ("h1",)),
        Node("Squeeze", ("h1", "zero"), ("y",)),
    )
    return Graph("x", "y", 10, 2, nodes, {"w": matrix, "zero": np.zeros(1)}, (State("h", "h1", 2),))


@pytest.mark.parametrize("around", [lambda one: one, compensated], ids=["policy", "layer"])
@pytest.mark.parametrize(
    "network", [random_network(10, 8, 2), accumulating()], ids=["plain", "rnn"]
)
def test_robots_that_have_ended_change_no_bit_of_those_that_go_on(
    network: Graph, around: Callable[[Policy], Design]
):
    own = around(policy(graph=network))
    ends = {2: [0, 2, 3, 4], 4: [2, 4], 5: [4]}
    whole, ended = (own.batch(np.zeros((5, own.weights)), [frozenset()] * 5) for _ in range(2))
    going = list(range(5))
    for k in range(8):
        going = ends.get(k, going)
        if k in ends:
            ended.end(np.array(going))
        commands = np.empty((2, 5, len(MOTORS)))
        for batch, targets in zip((whole, ended), commands, strict=True):
            feel(batch, k)
            batch.step(targets)
        np.testing.assert_array_equal(commands[0, going], commands[1, going])
        assert (commands[0] == commands[1]).all() == (k < 2)


def test_commands_are_offset_and_scale_of_a_clipped_output_and_other_motors_hold():
    network, action = constant(1.5, -2.5, inputs=2), replace(INTERFACE.action, clip=2.0)
    own = policy("last_action", graph=network, action=action)
    every = (own, policy("last_action", graph=network), policy(graph=constant(99, -99, inputs=10)))
    clipped, plain, far = (commanded(each, steps=1)[0, 0] for each in every)

    np.testing.assert_allclose(clipped, (0.4 - 0.2 * 2.0, 0.2, -0.9 + 0.1 * 1.5), atol=1e-12)
    np.testing.assert_allclose(plain, (0.4 - 0.2 * 2.5, 0.2, -0.9 + 0.1 * 1.5), atol=1e-12)
    assert far.tolist() == [-0.25, 0.2, -0.5]
    assert seen(own, 2)[1] == [1.5, -2.0]
    assert own.neutral == (0.4, 0.2, -0.9)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"graph": random_network(11, 2)}, r"has 11 inputs, and its terms 10 \(gravity 3, joint_p"),
        ({"history": 2, "graph": random_network(10, 2)}, "10 inputs, and its terms 20 .*, 2 times"),
        ({"graph": random_network(10, 3)}, "network has 3 outputs, and there are 2 motors"),
        ({"pose": (0.0,)}, "expected 2 numbers of its pose, got 1"),
        ({"velocity": (0.0,) * 4}, "expected 3 numbers of its velocity, got 4"),
        ({"holding": (0.0,)}, "expected 3 numbers of its holding, got 1"),
        ({"action": replace(INTERFACE.action, scale=(1.0,))}, "2 numbers of its action's scale"),
        ({"action": replace(INTERFACE.action, offset=())}, "2 numbers of its action's offset"),
        (
            {"action": replace(INTERFACE.action, motors=("leg", "hip"))},
            "unknown motor 'leg'",
        ),
        ({"action": replace(INTERFACE.action, motors=("hip", "hip"))}, "it names a motor twice"),
        ({"joints": ("hip", "leg")}, "unknown joint 'leg': the known ones are hip, free, knee"),
        ({"joints": ("hip", "hip")}, "it names a joint twice"),
        ({"decimation": 0}, "expected a history of 1 to 1000, and a decimation"),
        ({"period": math.nan}, "and a period of 0.001 s or more"),
        ({"terms": ()}, "expected a preset or terms of an observation, got none"),
        ({"terms": (Term("height"),)}, "unknown term 'height'.*linear_velocity"),
        ({"terms": (Term("gravity", (1.0, 2.0)),)}, "1 or 3 numbers of the term gravity, got 2"),
        ({"terms": (Term("phase", (1.0,), (0.0,) * 3),)}, "1 or 2 numbers of the term phase, got"),
    ],
)
def test_a_policy_that_does_not_fit_is_refused_with_both_numbers(changes: dict, match: str):
    with pytest.raises(ValueError, match=match):
        policy(**{"graph": random_network(10, 2), **changes})
