"""Promises of layer files: their formula gives the commands, and the layer comes back from them."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.controllers.trained import Finetuned
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.logs.policies import read_network
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import TrialPlan
from tests.helpers.policies import (
    POLICY as POLICY_TEXT,
    onnx_bytes,
    policy,
    policy_of,
)


def layered(base: Design, *, feedback: bool = True) -> Controller:
    """A random layer around a random controller of a design."""
    rng = np.random.default_rng(1)
    own = Compensated.around(
        Controller(base, draw_genomes(rng, (base.weights,))), feedback=feedback
    )
    return Controller(own, draw_genomes(rng, (own.weights,)))


def applied(layer: dict, motors: tuple[str, ...], own: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """The formula in the header of a file, as the software of a robot has it."""
    commands = []
    for motor, command in zip(motors, own, strict=True):
        m = layer["motors"][motor]
        changed = command + (command - m["neutral"]) * (m["gain"] - 1) + m["offset"]
        changed += np.dot(m.get("response", [0] * 5), felt)
        commands.append(min(max(changed, m["low"]), m["high"]))
    return np.array(commands)


@pytest.mark.parametrize("feedback", [False, True])
def test_the_formula_on_a_recorded_trial_gives_its_commands(
    tmp_path: Path, quadruped: Robot, *, feedback: bool
):
    base = policy_of(tmp_path, quadruped, "velocity = [0.3, 0.0, 0.1]\n" + POLICY_TEXT)
    own = layered(base.design, feedback=feedback)
    runner = TrialRunner(tmp_path, quadruped, Settings())
    plan = TrialPlan("02-recovery", "recovery", own, 60, 0)
    logged = runner(SimulatedRobot(quadruped), plan).trajectory
    layer = tomllib.loads((tmp_path / "02-recovery.toml").read_text())
    brain = base.design.batch(np.empty((1, 0)), [frozenset()])
    brain.velocity = brain.velocity + layer["velocity_shift"]
    within = np.empty((1, len(quadruped.anatomy.motors)))
    for k in range(60):
        for signal in SIGNALS:
            if signal in brain.observed:
                brain.observed[signal][0] = logged[signal][k]
        brain.step(within)
        w, x, y, z = logged["base_orientation"][k]
        felt = [2 * (w * y - x * z), -2 * (w * x + y * z), *logged["base_angular_velocity"][k]]
        found = applied(layer, quadruped.anatomy.motors, within[0], np.array(felt))
        np.testing.assert_allclose(found, logged["commands"][k], rtol=0, atol=1e-12)
    assert np.ptp(logged["commands"], axis=0).min() > 0.01


def test_the_change_of_a_fine_tuned_network_is_that_of_the_tensor_in_its_onnx_file(tmp_path: Path):
    weights = np.random.default_rng(0).normal(size=(10, 2)).astype(np.float32)
    path = tmp_path / "network.onnx"
    path.write_bytes(onnx_bytes("y = MatMul(x, w)", {"w": weights}, 10, 2))
    own = Finetuned.of(policy(graph=read_network(path)), np.ones((1, 10)))
    genome = np.array([0.5, -0.25])
    numbers = tomllib.loads(own.layer_file(genome))
    rows = np.random.default_rng(1).normal(size=(3, 10))

    assert numbers["tensor"] == "w"
    changed = rows @ (weights + np.array(numbers["change"]))
    np.testing.assert_allclose(own.policy(genome).graph(rows), changed, atol=1e-6)
