"""Promises of the scaled stiffness and damping of contacts."""

import mujoco
import numpy as np
import pytest

from selfmodel.simulation.model_factors import scale_contacts

TIMESTEP = 0.005
BALL = """<mujoco><option timestep="{timestep}"/><worldbody>
<geom name="ground" type="plane" size="1 1 1"/>
<body pos="0 0 1"><freejoint/>
<geom name="ball" size="0.1" mass="1" solref="{solref}" priority="1" solimp="0.9 0.9 0.01"/></body>
</worldbody></mujoco>"""


def ball(solref: str, timestep: float = TIMESTEP) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(BALL.format(solref=solref, timestep=timestep))


def reference(model: mujoco.MjModel) -> np.ndarray:
    """Returns the stiffness and the damping that MuJoCo's contact has."""
    data = mujoco.MjData(model)
    data.qpos[2] = 0.099
    mujoco.mj_forward(model, data)
    return data.efc_KBIP[0, :2].copy()


@pytest.mark.parametrize("timestep", [0.002, 0.01])
@pytest.mark.parametrize("solref", ["0.02 1", "0.01 1", "0.005 1", "0.001 0.5", "0.04 0.3"])
@pytest.mark.parametrize("factors", [(1, 0.5), (4, 1), (0.25, 0.5), (1, 2), (2, 0.25), (4, 2)])
def test_a_time_constant_that_mujoco_limits_has_the_scaled_stiffness_and_damping(
    solref: str, timestep: float, factors: tuple[float, float]
):
    model = ball(solref, timestep)
    stiffness, damping = reference(model)
    width = 0.9
    scale_contacts(model, *factors)
    found = reference(model)

    largest = np.maximum(stiffness, (1 / width / timestep) ** 2)
    assert found[0] == pytest.approx(min(factors[0] * stiffness, largest))
    assert found[1] == pytest.approx(min(factors[1] * damping, 1 / (width * timestep)))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("factors", "solrefs"),
    [
        ((2.0, 0.5), ("0.02 -1", "-5000 300", "0 1")),
        ((1.0, 1.0), ("-90000 -500", "0.0123456789 0.7", "-5000 -300")),
    ],
    ids=["mujoco replaces them", "factors of 1"],
)
def test_contacts_that_remain_as_they_are_to_the_bit(
    factors: tuple[float, float], solrefs: tuple[str, ...]
):
    for model in map(ball, solrefs):
        before = model.geom("ball").solref.copy()
        scale_contacts(model, *factors)

        assert model.geom("ball").solref.tobytes() == before.tobytes()


def test_contact_pairs_are_scaled_too():
    text = BALL.format(solref="-2000 -50", timestep=TIMESTEP).replace(
        "</mujoco>",
        '<contact><pair geom1="ground" geom2="ball" solref="-1000 -20"/></contact></mujoco>',
    )
    model = mujoco.MjModel.from_xml_string(text)
    scale_contacts(model, 2.0, 0.5)

    np.testing.assert_allclose(model.pair_solref, [[-2000, -10]])


@pytest.mark.parametrize(
    ("solref", "scaled"),
    [
        ("-2000 -50", (-4000, -100)),
        ("-30000 -150", (-40000, -200)),
        ("-90000 -500", (-90000, -500)),
    ],
)
def test_stated_parameters_grow_to_what_a_step_can_integrate(
    solref: str, scaled: tuple[float, float]
):
    model = ball(solref)
    scale_contacts(model, 2.0, 2.0)

    np.testing.assert_allclose(model.geom("ball").solref, scaled)
