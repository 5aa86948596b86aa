"""Promises of policies in environments: logs are those of trials, episodes the environment's."""

from pathlib import Path

import gymnasium
import numpy as np
import pytest
from dm_control import suite

import selfmodel
from selfmodel import tasks
from selfmodel.errors import InputError, TrialError
from selfmodel.robot.designs import network_for
from selfmodel.tasks.gymnasium_env import env_id

KNEE = "break:front_left_knee"
WALKER = "suite-walker-walk"


def walk() -> selfmodel.Controller:
    design = network_for(selfmodel.load_robot("quadruped"))
    return selfmodel.Controller(design, np.linspace(-1, 1, design.weights))


def environments(**kwargs: object) -> list[object]:
    """The walking task as an environment of dm_control and of Gymnasium."""
    made = gymnasium.make(env_id("quadruped", "walk"), **kwargs, disable_env_checker=True)
    return [tasks.load("quadruped", "walk", kwargs), made]


@pytest.mark.parametrize("place", [0, 1])
@pytest.mark.parametrize("function", [None, lambda seen: 0.3 * np.sin(9 * seen["sensors"])])
def test_the_log_of_a_policy_replays_to_the_bit(tmp_path: Path, place: int, function: object):
    env, path = environments(hypothesis=KNEE)[place], tmp_path / "new.mcap"
    policy = function or walk()
    trial = selfmodel.record(env, policy, path, robot="quadruped", steps=60)

    assert selfmodel.read_log(path).timing.late.sum() == 0
    assert selfmodel.replay(trial, KNEE, "quadruped").identical
    assert not selfmodel.replay(path, "intact", "quadruped").identical


def test_the_state_of_a_task_of_the_suite_is_logged_with_the_readings_of_the_robot(tmp_path: Path):
    env, robot = suite.load("walker", "walk", {"random": 0}), selfmodel.load_robot(WALKER)
    path, poses = tmp_path / "new.mcap", []

    def policy(_: object) -> np.ndarray:
        poses.append(env.physics.named.data.qpos[list(robot.anatomy.hinges)].copy())
        return np.full(6, 0.5)

    trajectory = selfmodel.record(env, policy, path, robot=robot, steps=50).trajectory

    touches, angles = trajectory["sensors"][:, :2], trajectory["sensors"][:, 2:]
    assert set(touches.ravel()) == {0.0, 1.0}
    centres, halves = np.array(
        [(one.centre, one.half_range) for one in robot.anatomy.sensors[2:]]
    ).T
    np.testing.assert_allclose(angles, (poses - centres) / halves, atol=1e-12)
    np.testing.assert_array_equal(trajectory["joint_positions"], poses)
    assert np.isfinite(trajectory["base_position"]).all()


def test_a_network_drives_a_task_of_the_suite_with_the_body_of_its_robot(tmp_path: Path):
    env = suite.load("walker", "walk", {"random": 0})
    design = network_for(selfmodel.load_robot(WALKER))
    network = selfmodel.Controller(design, np.linspace(-1, 1, design.weights))
    path = tmp_path / "new.mcap"
    seen = selfmodel.record(env, network, path, robot=WALKER, steps=50).trajectory

    assert selfmodel.evaluate(env, network, robot=WALKER, steps=50)[0].steps == 50
    assert len(np.unique(seen["commands"], axis=0)) > 40, "the commands follow the readings"
    env.physics.model.body_mass[2] *= 2
    with pytest.raises(InputError, match=r'such as lambda seen: \{"sensors": seen\[:8\]\}, with'):
        selfmodel.evaluate(env, network, robot=WALKER, steps=50)


def test_episodes_have_the_return_of_the_environment_and_end_with_it():
    for env in environments(time_limit=0.5):
        one, other = selfmodel.evaluate(env, walk(), robot="quadruped", episodes=2)

        assert one == other
        assert (one.steps, one.fell_at_step) == (51, None)
        # The reward is the forward speed over a step of 0.01 s.
        assert one.episode_return == pytest.approx(one.displacement / 0.01)
        assert one.score == one.displacement


def test_the_log_of_an_episode_that_ends_early_is_whole(tmp_path: Path):
    env = tasks.load("quadruped", "walk", {"time_limit": 0.5})
    with pytest.raises(TrialError, match="ended its episode after 51 of 60 steps"):
        selfmodel.record(env, walk(), tmp_path / "new.mcap", robot="quadruped", steps=60)

    assert selfmodel.read_log(tmp_path / "new.mcap").trial.trajectory.steps == 51


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"env": 5}, "expected a dm_env or Gymnasium environment, got 5: give one such as"),
        ({"robot": WALKER}, "steps of 0.01 s, and suite-walker-walk of 0.025 s"),
        ({"robot": "hexapod"}, "another body than hexapod .*: give the robot of this body"),
        ({"policy": 5}, "expected the path of a controller, or a Controller, got .* int"),
        (
            {"policy": lambda _: [0.1]},
            r"<lambda> returns .* of the shape \(1,\), expected .* \(8,\)",
        ),
        (
            {"policy": lambda _: "left"},
            "<lambda> failed: ValueError: .*'left'.*; the motors are",
        ),
        ({"score": "uprigt"}, "unknown score 'uprigt': did you mean upright"),
        ({"episodes": 0}, "of 1 or above as episodes, got 0"),
        ({"steps": 0.5}, "of 2 or above as steps, got 0.5"),
    ],
)
def test_a_wrong_argument_is_refused_in_a_sentence(options: dict, sentence: str):
    given = {"policy": walk(), "robot": "quadruped", "steps": 5, **options}
    env = given.pop("env", None) or tasks.load("quadruped", "walk")

    with pytest.raises(InputError, match=sentence):
        selfmodel.evaluate(env, given.pop("policy"), **given)
