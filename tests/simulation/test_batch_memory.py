import numpy as np
import pytest

from selfmodel.comparators import SEGMENT_PREDICTION
from selfmodel.diagnosis.evidence import Evidence
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.physical.simulated_robot import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import Budget, BudgetError
from selfmodel.simulation.batch_memory import hypothesis_bytes, largest_batch
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.trial import TrialPlan
from tests.helpers.drivers import random_controllers
from tests.helpers.memory import in_memory
from tests.logs.hostile import outcome

RECORD = ("base_position", "sensors")
STEPS = 60


@pytest.mark.parametrize(
    ("request_", "models"), [(ClosedLoop(RECORD), 1), (Ensemble(RECORD, members=6, level=0.05), 6)]
)
def test_each_simulation_counts_its_model_and_its_signals(
    quadruped: Robot, request_: Request, models: int
):
    needed = hypothesis_bytes(quadruped, request_, STEPS)
    signals = models * STEPS * (3 + len(quadruped.anatomy.sensors)) * 8

    assert needed > models * quadruped.model.nbuffer + signals
    assert hypothesis_bytes(quadruped, request_, 10**6) > 10**6 * signals / STEPS


def test_a_batch_fits_into_the_budget(quadruped: Robot):
    request, budget = ClosedLoop(RECORD), Budget(memory=10**7)
    size = largest_batch(quadruped, request, STEPS, budget)

    assert size > 1
    assert size * hypothesis_bytes(quadruped, request, STEPS) <= budget.models_bytes


def test_a_hypothesis_that_does_not_fit_alone_is_refused_with_the_remedy(quadruped: Robot):
    with pytest.raises(BudgetError, match=r"one hypothesis takes .* GB.*--budget memory="):
        largest_batch(quadruped, ClosedLoop(RECORD), 10**7, Budget())


HFIELD = '<asset><hfield name="h" nrow="2800" ncol="2800" size="1 1 1 1"/></asset><worldbody>'


@pytest.mark.process
def test_many_hypotheses_of_a_large_model_are_judged_within_the_budget(quadruped: Robot):
    large = quadruped.mjcf.replace("<worldbody>", HFIELD, 1)
    texts = [f"motor:front_left_knee={k / 100:.2f}" for k in range(10, 50)]

    def judged() -> None:
        robot = Robot("large", large, quadruped.control_timestep)
        trial = in_memory(robot)(
            SimulatedRobot(robot), TrialPlan("0", "after", random_controllers(robot, 1)[0], 60, 0)
        )
        hypotheses = [INTACT, *(parse(text, robot.anatomy) for text in texts)]
        losses = Evidence(Simulator(robot, 1), SEGMENT_PREDICTION).losses(hypotheses, [trial])
        assert np.isfinite(losses).all()

    assert outcome(judged).megabytes < 800
