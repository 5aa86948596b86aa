"""A fault in the movement of a healthy trial: what it gains beyond that trial tells it."""

from collections.abc import Sequence

import mujoco
import numpy as np
import pytest

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.diagnosis.alternatives import leads_of
from selfmodel.diagnosis.losses import LossTable
from selfmodel.diagnosis.search import LocalSearch
from selfmodel.diagnosis.significance import MIN_Z, MIN_Z_ACROSS_TRIALS, contrast, is_better
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import JAMMED, SERVO_GAIN, WEAK_MOTOR
from selfmodel.faults.notation import parse
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import Trial
from tests.diagnosis.synthetic import Synthetic, problem_of
from tests.helpers.robots.arms import robot_of

PIECES = 40
SERVO = """<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody><body name="stand"><geom size="0.02" contype="0" conaffinity="0"/>
    <body name="arm">
      <joint name="servo" axis="0 1 0" range="-3 3" damping="0.05" frictionloss="{friction}"/>
      <geom size="0.02" pos="0 0 -0.1" mass="0.5" contype="0" conaffinity="0"/>
    </body>
  </body></worldbody>
  <actuator><position name="servo" joint="servo" kp="{gain}" ctrlrange="-3 3"/></actuator>
</mujoco>"""


@pytest.fixture(scope="module")
def servo() -> Robot:
    """A self-model with too little friction."""
    return robot_of(SERVO.format(friction=0.02, gain=3.0), control_timestep=0.01)


def test_an_error_of_the_state_does_not_grow_on_a_bench(
    servo: Robot, monkeypatch: pytest.MonkeyPatch
):
    healthy, other = moved(servo, 3.0), moved(servo, 3.0, pace=2)
    table = LossTable(Simulator(servo, 1), SEGMENT_PREDICTION)
    problem = problem_of(table, servo, [other], [healthy], (WEAK_MOTOR,))
    monkeypatch.setattr(table, "sensitivity", lambda *_: pytest.fail("asked"))

    np.testing.assert_array_equal(problem.expected(INTACT), table.losses([INTACT], [healthy])[0])


def moved(
    servo: Robot, gain: float, *, amplitude: float = 1.0, pace: int = 1, seed: int = 0
) -> Trial:
    """A noisy trial of 6 s of a servo with more friction than the self-model."""
    model = mujoco.MjModel.from_xml_string(SERVO.format(friction=0.1, gain=gain))
    data, states = mujoco.MjData(model), []
    turn = 2 * np.pi * pace * np.arange(600) * servo.control_timestep
    commands = amplitude * (np.sin(turn) + 0.5 * np.sin(0.37 * turn))[:, np.newaxis]
    for row in commands:
        states.append(np.concatenate([data.qpos, data.qvel]))
        data.ctrl[:] = row
        mujoco.mj_step(model, data, servo.substeps)
    noise = np.random.default_rng(seed).normal(0, (0.002, 0.04), (len(states), 2))
    positions, velocities = np.hsplit(np.array(states) + noise, 2)
    name = f"{gain}-{amplitude}-{pace}-{seed}"
    return Trial.from_arrays(servo, positions, commands, joint_velocities=velocities, name=name)


def contrast_of(servo: Robot, trial: Trial, faults: str, *healthy: Trial) -> float:
    return contrast_of_all(servo, [trial], faults, *healthy)


def contrast_of_all(servo: Robot, trials: Sequence[Trial], faults: str, *healthy: Trial) -> float:
    table = LossTable(Simulator(servo, 1), SEGMENT_PREDICTION)
    problem = problem_of(table, servo, trials, healthy, (WEAK_MOTOR, JAMMED))
    return problem.contrast(parse(faults, servo.anatomy))


def test_only_another_robot_gains_beyond_a_healthy_trial_of_the_same_movement(servo: Robot):
    weak, again = moved(servo, 1.8, seed=1), moved(servo, 3.0, seed=2)
    healthy, smaller = moved(servo, 3.0), moved(servo, 3.0, amplitude=0.8)
    given = (servo, weak, "motor:servo=0.6")

    assert contrast_of(*given, healthy) > MIN_Z
    assert contrast_of(servo, again, "motor:servo=0.9", healthy) < 1.0
    assert contrast_of(*given, smaller) == 0.0
    assert contrast_of(*given, moved(servo, 3.0, pace=2)) == 0.0
    assert contrast_of(*given, smaller, healthy) == contrast_of(*given, healthy)
    assert contrast_of_all(servo, [weak, moved(servo, 1.8, pace=2)], given[2], healthy) == 0.0
    assert contrast_of(servo, weak, "motor:servo=0.6+sensor:servo_angle", healthy) == 0.0


def test_a_contrast_needs_a_gain_and_losses_that_can_be_compared():
    own, healthy = np.linspace(1.0, 2.0, 8), np.linspace(0.1, 0.3, 8)
    worse = healthy + np.linspace(0.2, 0.4, 8)

    assert contrast(own - 0.1, own, worse, healthy) > MIN_Z_ACROSS_TRIALS
    assert contrast(own + 0.01, own, worse, healthy) == 0.0
    assert contrast(own - 0.1, own, np.full(8, np.inf), healthy) == 0.0


WEAK = "motor:servo=0.5"


def contrasting(servo: Robot, z: float) -> Synthetic:
    """A problem in which a weak motor has no significant lead, but a contrast."""
    weak = parse(WEAK, servo.anatomy)
    swing = 0.4 * np.resize([1.0, -1.0], PIECES)

    def losses(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        base = np.linspace(0.9, 1.1, PIECES)
        rows = {weak: base - 0.1 + swing, INTACT: base}
        return np.array([rows.get(one, base * (1.0 + len(one))) for one in hypotheses])

    problem = Synthetic(HypothesisSpace(servo.anatomy, (WEAK_MOTOR, SERVO_GAIN)), losses)
    problem.contrast = lambda one: z if one == weak else 0.0
    assert not is_better(*losses([weak, INTACT]))
    return problem


@pytest.mark.parametrize(("z", "found"), [(1.01, WEAK), (0.99, "intact")])
def test_a_fault_with_a_contrast_of_five_standard_errors_is_found(
    servo: Robot, z: float, found: str
):
    problem = contrasting(servo, z * MIN_Z_ACROSS_TRIALS)

    assert str(LocalSearch(problem).refined([])) == found


@pytest.mark.parametrize("z", [4.0, 6.0])
def test_the_lead_over_the_empty_hypothesis_is_at_least_the_contrast(servo: Robot, z: float):
    problem = contrasting(servo, z)

    assert leads_of(parse(WEAK, servo.anatomy), problem)[INTACT] == z
