import numpy as np
import pytest

from selfmodel.errors import InputError
from selfmodel.robot.mjcf import rehearsal
from selfmodel.robot.mjcf.rehearsal import ModelCost, physics_timestep, rehearse
from selfmodel.robot.robot import Robot
from selfmodel.sandbox.budget import DEFAULT_BUDGET, Budget, BudgetError
from selfmodel.sandbox.isolation import Isolated
from tests.robot.mjcf.awkward import GROUND, TORSO, mjcf

BOX = '<geom type="box" size="0.3 0.3 0.3" {}/>'
TIMESTEP = 0.002


def cost(text: str, budget: Budget = DEFAULT_BUDGET) -> ModelCost:
    return rehearse(text, {}, TIMESTEP, budget)


def test_the_cost_of_a_model_is_measured(quadruped: Robot):
    found = rehearse(quadruped.mjcf, quadruped.assets, quadruped.control_timestep)

    assert found.model_bytes == quadruped.model.nbuffer
    assert found.data_bytes > quadruped.model.narena
    assert 0 < found.step_seconds < found.compile_seconds < 5
    assert found.failure == ""


def test_a_model_is_measured_once():
    assert cost(mjcf()) is cost(mjcf())
    assert cost(mjcf()) is not cost(mjcf(), Budget(memory=9 * 10**8))


def test_too_many_contacts_are_a_failure_of_the_first_steps():
    crowd = 120 * BOX.format('pos="0 0 .35"')
    text = mjcf(world=crowd, torso=125 * BOX.format(""), more='<size memory="1M"/>')

    assert "out of memory" in cost(text).failure


def test_divergence_is_a_failure_of_the_first_steps():
    text = mjcf(more='<option timestep="0.002"/><default><joint stiffness="1e9"/></default>')
    text = text.replace("axis=", 'springref="900" axis=')

    assert "unstable" in cost(text).failure


def test_a_model_that_mujoco_cannot_compile_is_refused():
    with pytest.raises(InputError, match=r"MuJoCo cannot use the model: .*leg"):
        cost(mjcf(more="<leg/>"))


def test_a_model_that_is_no_robot_is_refused():
    with pytest.raises(InputError, match="slide joint"):
        cost(mjcf(torso=TORSO + '<body><joint type="slide"/><geom size=".1"/></body>'))


@pytest.mark.parametrize("rows", [6000, 60_000])
def test_a_model_beyond_the_budget_is_refused_with_the_remedy(rows: int):
    field = f'<asset><hfield name="h" nrow="{rows}" ncol="6000" size="2 2 .1 .1"/></asset>'

    with pytest.raises(BudgetError, match=r"memory.*--budget memory="):
        cost(mjcf(more=field), Budget(memory=4 * 10**8))


def test_a_solver_has_a_bounded_number_of_iterations():
    with pytest.raises(InputError, match="noslip_iterations=20000, expected at most 10000"):
        cost(mjcf(more='<option noslip_iterations="20000"/>'))


def test_a_heavier_model_takes_longer_steps():
    crowd = mjcf(world=GROUND + 30 * BOX.format('pos="0 0 .35"'), more='<size memory="50M"/>')

    assert cost(crowd).step_seconds > 2 * cost(mjcf()).step_seconds
    assert np.isfinite(cost(crowd).step_seconds)


def test_a_model_has_half_of_the_processor_time_because_it_is_compiled_twice(
    monkeypatch: pytest.MonkeyPatch,
):
    def slow(*_: object) -> Isolated:
        return Isolated(FACTS, {}, seconds=6.0, peak=0)

    monkeypatch.setattr(rehearsal, "run_on_model", slow)
    with pytest.raises(BudgetError, match=r"takes 12 s of processor time, more than 10 s"):
        cost("<slow/>")
    assert cost("<slow/>", Budget(time=220)).compile_seconds == 5


FACTS = {
    **dict.fromkeys(("model_bytes", "data_bytes", "step_seconds"), 1),
    "compile_seconds": 5,
    "failure": "",
}


@pytest.mark.parametrize("timestep", ["0", "-0.01", "nan", "inf"])
def test_a_physics_time_step_that_is_not_positive_and_finite_is_refused(timestep: str):
    with pytest.raises(InputError, match="the physics time step must be above 0 s"):
        physics_timestep(f'<mujoco><option timestep="{timestep}"/></mujoco>')


def test_the_physics_time_step_is_that_of_the_compiled_model():
    text = '<mujoco><option timestep="0.004"/><worldbody/></mujoco>'

    assert physics_timestep(text) == 0.004


def test_the_time_step_of_a_model_that_exceeds_the_budget_is_not_read():
    grid = '<asset><hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/></asset>'

    with pytest.raises(BudgetError, match="--budget memory="):
        physics_timestep(f"<mujoco>{grid}<worldbody/></mujoco>")
