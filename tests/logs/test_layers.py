"""Promises of layer files: their formula gives the commands, and the layer comes back from them."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.controllers.cpg import Cpg
from selfmodel.errors import InputError
from selfmodel.logs.layers import layer_text, read_layer
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.logs.policies import policy_controller
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trial import TrialPlan
from tests.helpers.policies import (
    MOTORS,
    POLICY as POLICY_TEXT,
    RANGES,
    SENSORS,
    policy,
    policy_of,
    save_policy,
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


@pytest.mark.parametrize("base", [policy(), Cpg(SENSORS, MOTORS, 0.02, ranges=RANGES)])
@pytest.mark.parametrize("feedback", [False, True])
def test_a_layer_comes_back_from_its_file(tmp_path: Path, base: Design, *, feedback: bool):
    before, path = layered(base, feedback=feedback), tmp_path / "layer.toml"
    path.write_text(layer_text(before))
    after = read_layer(path, before.design.base)

    assert after.design == before.design
    np.testing.assert_allclose(after.genome, before.genome, rtol=0, atol=1e-12)
    assert "own - neutral) * (gain - 1)" in path.read_text()


def test_a_policy_file_names_a_layer(tmp_path: Path, quadruped: Robot):
    base = policy_of(tmp_path, quadruped)
    before = layered(base.design)
    (tmp_path / "layer.toml").write_text(layer_text(before))
    path = save_policy(tmp_path, quadruped, 'layer = "layer.toml"\n' + POLICY_TEXT)
    after = policy_controller(path, quadruped)

    assert after.design == before.design
    np.testing.assert_allclose(after.genome, before.genome, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ('"hip"', '"hop"', "'hip'"),
        ("response = [", "response = [1.0, ", "inhomogeneous|reshape"),
        ("velocity_shift = [", "velocity_shift = [0.0, ", "reshape"),
        ("gain = ", "gain = -", "Expected `float` > 0"),
        ("gain = ", "gain = 90", r"every weight must lie in \[-1, 1\]"),
        ("offset", "ofset", "unknown field `ofset`|missing required field `offset`"),
    ],
)
def test_an_altered_layer_file_is_refused(tmp_path: Path, old: str, new: str, match: str):
    before, path = layered(policy()), tmp_path / "layer.toml"
    header, numbers = layer_text(before).split("\n\n", 1)
    assert old in numbers
    path.write_text(f"{header}\n\n{numbers.replace(old, new, 1)}")
    with pytest.raises(InputError, match=rf"layer\.toml: expected the layer of .*{match}"):
        read_layer(path, before.design.base)
