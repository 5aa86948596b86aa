"""Promises of controllers that hold their heading: strides by the turn, and starts that differ."""

from dataclasses import replace

import numpy as np
import pytest

from selfmodel.controllers.controller import Controller, Design, HeadingHold, draw_genomes
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.recovery.repair import HEADINGS, RobustRepair
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.designs import DESIGNS
from selfmodel.robot.robot import Robot
from selfmodel.rotation import directions
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import entry

BOTH = pytest.mark.parametrize("name", ["network", "cpg"])


def commands(design: Design, genome: np.ndarray, turns: list[float]) -> np.ndarray:
    """The commands of a second while robots are turned to the left, ``(steps, n, motors)``."""
    batch = design.batch(np.tile(genome, (len(turns), 1)), [frozenset()] * len(turns))
    for orientation in batch.observed.values():
        half = np.array(turns) / 2
        orientation[:, 0], orientation[:, 3] = np.cos(half), np.sin(half)
    batch.readings[:] = 0.5
    found = np.empty((100, len(turns), len(design.motors)))
    for each in found:
        batch.step(each)
    return found


def test_strides_grow_to_one_side_and_shrink_to_the_other_by_the_turn():
    hold = HeadingHold(np.tile([1.0, -1.0, 0.5], (4, 1)))
    turns = np.array([0.0, 0.25, -0.25, -3.0])
    for orientation in hold.observed.values():
        orientation[:, 0], orientation[:, 3] = np.cos(turns / 2), np.sin(turns / 2)
    outputs = np.full((4, 3), 0.4)
    hold.scale(outputs)
    factors = [[1, 1, 1], [1.5, 0.5, 1.25], [0.5, 1.5, 0.75], [0, 2, 0.5]]
    np.testing.assert_allclose(outputs, 0.4 * np.array(factors), rtol=1e-12)


@BOTH
def test_straight_ahead_the_commands_are_those_without_a_hold_and_always_in_the_range(
    quadruped: Robot, name: str
):
    plain, design = (DESIGNS[each](quadruped, None) for each in (name, f"{name}+heading"))
    assert design.weights == plain.weights + len(plain.motors)
    assert (plain.observes, design.observes) == ((), ("base_orientation",))
    own = draw_genomes(np.random.default_rng(0), (plain.weights,))
    genome = np.append(own, np.ones(len(plain.motors)))
    straight, left = np.swapaxes(commands(design, genome, [0.0, 1.0]), 0, 1)
    np.testing.assert_array_equal(straight, commands(plain, own, [0.0])[:, 0])
    assert (np.ptp(left, axis=0) > np.ptp(straight, axis=0)).any()
    assert (np.abs(left) <= np.pi / 4).all()


@BOTH
@pytest.mark.parametrize("body", ["suite-walker-walk", "suite-swimmer-swimmer6"])
def test_a_robot_that_cannot_hold_a_heading_is_refused(name: str, body: str):
    with pytest.raises(InputError, match=f"a free base whose x axis .* got {body}: leave \\+head"):
        DESIGNS[f"{name}+heading"](entry(body).robot(), None)


@BOTH
def test_only_what_holds_its_heading_is_evolved_from_headings_that_differ(
    quadruped: Robot, name: str, monkeypatch: pytest.MonkeyPatch
):
    settings, starts = replace(Settings(steps=20, generations=1).scaled(4)), list[np.ndarray]()
    run_under = Simulator.run_under

    def noted(self: Simulator, *given: object, **options: object) -> object:
        *given, record = given
        outcome = run_under(self, *given, (*record, "base_orientation"), **options)
        ahead = directions(outcome.trajectory["base_orientation"][..., 0, :])
        starts.append(np.arctan2(ahead[..., 1], ahead[..., 0]).ravel())
        return outcome

    monkeypatch.setattr(Simulator, "run_under", noted)
    for design in (DESIGNS[each](quadruped, None) for each in (name, f"{name}+heading")):
        starts.clear()
        repair = RobustRepair(Simulator(quadruped, 1), settings, design)
        rng = np.random.default_rng(0)
        known = [Controller(design, draw_genomes(rng, (design.weights,)))]
        repair([INTACT], lambda: assumed_uncertainty(quadruped), known, rng, lambda _: None)
        headings = np.unique(np.concatenate(starts).round(6))
        if design.observes:
            assert headings.std() > HEADINGS / 4
        else:
            np.testing.assert_allclose(headings, 0, atol=1e-3)
