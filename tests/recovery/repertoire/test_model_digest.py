"""Promises of the digests of a model: what they depend on, and what they do not."""

from collections.abc import Callable
from types import SimpleNamespace

import pytest

from selfmodel.recovery.repertoire.model_digest import Modelled, model_digest, self_model_digest

ROBOT = {
    "name": "a",
    "mjcf": '<mujoco>\n  <!-- legs --><option timestep="0.01" density="1" />\n</mujoco>',
    "control_timestep": 0.02,
    "assets": {"foot.stl": b"1"},
}


def test_the_model_that_a_log_serialises_anew_has_the_digest_of_the_robot():
    robot = SimpleNamespace(**ROBOT)
    text = '<mujoco><option density="1" timestep="0.01"/></mujoco>'
    logged = SimpleNamespace(**{**ROBOT, "mjcf": text})

    assert self_model_digest(robot) == self_model_digest(logged)
    assert model_digest(robot) != model_digest(logged), "that of repertoires is of the text"


@pytest.mark.parametrize("digest", [model_digest, self_model_digest])
@pytest.mark.parametrize(
    "change",
    [
        {"mjcf": '<mujoco><option timestep="0.01" density="2"/></mujoco>'},
        {"control_timestep": 0.01},
        {"assets": {"foot.stl": b"2"}},
        {"assets": {"feet.stl": b"1"}},
    ],
)
def test_a_change_of_the_model_changes_its_digest(digest: Callable[[Modelled], str], change: dict):
    changed = SimpleNamespace(**{**ROBOT, **change})

    assert digest(changed) != digest(SimpleNamespace(**ROBOT))
