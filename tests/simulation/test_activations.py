"""Promises of activations: they are what the physics made of the commands, to the bit."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from selfmodel.robot.robot import Robot
from selfmodel.simulation.activations import initial_activations
from selfmodel.simulation.requests import Past, Segments

MJCF = """
<mujoco>
  <option timestep="0.005" integrator="{integrator}"/>
  <default><general gear="1e-3"/></default>
  <worldbody>
    <body name="torso" pos="0 0 1">
      <freejoint/>
      <geom size=".1"/>
      <body name="leg"><joint name="hip" range="-1 1" axis="0 1 0"/><geom size=".1"/></body>
    </body>
  </worldbody>
  <actuator>
    <general name="plain" joint="hip"/>
    <general name="slow" joint="hip" dyntype="filter" dynprm=".1" ctrlrange="-1 .5"/>
    <general name="exact" joint="hip" dyntype="filterexact" dynprm=".02"/>
    <general name="bound" joint="hip" dyntype="filter" dynprm=".05" actlimited="true"
             actrange="-.2 .3"/>
    <general name="adding" joint="hip" dyntype="integrator" actlimited="true" actrange="-.1 .05"/>
    <general name="fast" joint="hip" dyntype="filterexact" dynprm=".005"/>
  </actuator>
  <sensor><jointpos name="angle" joint="hip"/></sensor>
</mujoco>
"""
STEPS = 40
INTEGRATORS = ("Euler", "RK4", "implicit", "implicitfast")


def made(integrator: str, control_timestep: float = 0.02) -> Robot:
    return Robot("one-legged", MJCF.format(integrator=integrator), control_timestep)


def physics(robot: Robot, commands: np.ndarray, delay: int) -> np.ndarray:
    """The activations at each step, as MuJoCo has them."""
    data = mujoco.MjData(robot.model)
    rows = [data.act.copy()]
    for k in range(len(commands) - 1):
        data.ctrl[:] = commands[k - delay] if k >= delay else 0
        mujoco.mj_step(robot.model, data, robot.substeps)
        rows.append(data.act.copy())
    return np.array(rows)


def cut(commands: np.ndarray, starts: np.ndarray, lead: int, past: Past | None) -> Segments:
    padded = np.pad(commands, ((lead, 5), (0, 0)))
    rows = np.stack([padded[k : k + lead + 5] for k in starts])
    return Segments(states={}, commands=rows, lead=lead, record=("sensors",), past=past)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32),
    integrator=st.sampled_from(INTEGRATORS),
    delay=st.integers(0, 3),
    substeps=st.integers(1, 5),
)
def test_they_are_what_the_commands_since_the_start_made_of_them(
    seed: int, integrator: str, delay: int, substeps: int
):
    robot = made(integrator, substeps * 0.005)
    commands = np.random.default_rng(seed).normal(size=(STEPS, robot.model.nu))
    starts = np.array([0, 1, 7, STEPS - 1])
    segments = cut(commands, starts, 3, Past(commands, starts))

    np.testing.assert_array_equal(
        initial_activations(robot, segments, delay), physics(robot, commands, delay)[starts]
    )


def test_a_command_that_is_not_known_is_the_one_before():
    robot = made("Euler")
    commands = np.random.default_rng(0).normal(size=(STEPS, robot.model.nu))
    holes = commands.copy()
    holes[5:9] = np.nan
    commands[5:9] = commands[4]
    starts = np.array([20])

    np.testing.assert_array_equal(
        initial_activations(robot, cut(commands, starts, 0, Past(holes, starts)), 0),
        physics(robot, commands, 0)[starts],
    )


def test_without_the_past_what_followed_the_same_command_for_long_is_right():
    robot = made("Euler")
    commands = np.full((400, robot.model.nu), 0.4)
    starts = np.array([399])
    found = initial_activations(robot, cut(commands, starts, 3, None), 1)
    adding = 3  # of those with an activation

    np.testing.assert_allclose(
        np.delete(found, adding, axis=1),
        np.delete(physics(robot, commands, 1)[starts], adding, axis=1),
        atol=1e-9,
    )


@pytest.mark.parametrize("delay", [0, 2])
def test_without_the_past_the_commands_before_a_segment_count(delay: int):
    robot = made("Euler")
    commands = np.random.default_rng(1).normal(size=(STEPS, robot.model.nu))
    commands[: STEPS - 10] = commands[STEPS - 10]
    starts = np.array([STEPS - 1])
    found = initial_activations(robot, cut(commands, starts, 12, None), delay)
    fast = slice(4, None)

    np.testing.assert_allclose(
        found[:, fast], physics(robot, commands, delay)[starts][:, fast], atol=1e-6
    )


def test_motors_without_a_state_have_none(quadruped: Robot):
    commands = np.zeros((STEPS, quadruped.model.nu))

    assert initial_activations(quadruped, cut(commands, np.arange(4), 0, None), 0).shape == (4, 0)
