"""Promises of estimated joint velocities: exact for smooth motion, unknown where positions are."""

import dataclasses

import numpy as np

from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation.velocity_estimation import (
    lacks_joint_velocities,
    with_joint_velocities,
)
from selfmodel.trials.signals import Names

TIME = np.arange(200) * 0.005
NAMES = Names((), ("motor",), ("hinge", "other"))


def behaviour(**more: object) -> Behaviour:
    positions = np.stack([1 + 2 * TIME - 3 * TIME**2 + TIME**3, np.cos(6 * TIME)], axis=1)
    return Behaviour(NAMES, TIME, {"joint_positions": positions}, **more)


def test_the_velocity_of_a_cubic_is_exact():
    found = with_joint_velocities(behaviour())["joint_velocities"]

    np.testing.assert_allclose(found[:, 0], 2 - 6 * TIME + 3 * TIME**2, atol=1e-9)
    np.testing.assert_allclose(found[:, 1], -6 * np.sin(6 * TIME), atol=0.1)


def test_logged_velocities_are_kept():
    logged = {**behaviour().signals, "joint_velocities": np.full((200, 2), np.nan)}
    logged["joint_velocities"][7, 1] = 3.0
    known = dataclasses.replace(behaviour(), signals=logged)

    assert with_joint_velocities(known) is known
    assert not lacks_joint_velocities(known)
    assert lacks_joint_velocities(behaviour())


def test_velocities_near_unknown_positions_and_late_steps_are_unknown():
    late = np.zeros(200, dtype=bool)
    late[150] = True
    lost = behaviour(late=late)
    lost.signals["joint_positions"][50, 0] = np.nan
    unknown = np.isnan(with_joint_velocities(lost)["joint_velocities"])

    assert np.flatnonzero(unknown[:, 0]).tolist() == [*range(40, 61), *range(140, 161)]
    assert np.flatnonzero(unknown[:, 1]).tolist() == list(range(140, 161))
