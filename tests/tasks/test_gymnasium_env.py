"""Tests of the Gymnasium environments: Gymnasium's own checks, ids, seeds and vectors."""

import copy
import importlib
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from selfmodel import tasks
from selfmodel.errors import InputError
from selfmodel.tasks.gymnasium_env import FILE_ID, env_id, register

ANT = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "ant.xml"
ID = "selfmodel/Quadruped-walk-v0"
RANDOM = {"hypothesis": "break:front_left_knee+roughness=0.03", "gap": 0.05}
CHECKED = {
    "quadruped": (ID, {}),
    "random": (ID, RANDOM),
    "walker": ("selfmodel/suite-walker-walk-v0", {"hypothesis": "break:left_ankle"}),
    "file": (FILE_ID, {"robot": str(ANT), "start_noise": 0.05}),
}
every = pytest.mark.parametrize(
    ("name", "kwargs"),
    [
        pytest.param(*what, id=name, marks=() if name == "quadruped" else pytest.mark.bodies)
        for name, what in CHECKED.items()
    ],
)


@pytest.fixture
def env() -> Iterator[gymnasium.Env]:
    made = gymnasium.make(ID, **RANDOM, time_limit=0.05)
    yield made
    made.close()


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    return all(one[name].tobytes() == other[name].tobytes() for name in one)


@every
def test_gymnasiums_own_checks_pass_without_a_warning(name: str, kwargs: dict):
    made = gymnasium.make(name, **kwargs)

    check_env(made.unwrapped, skip_render_check=True)  # nothing is drawn without OpenGL
    made.close()


def test_every_task_has_an_id_once_registered():
    ids = {env_id(domain, task) for domain, task in tasks.ALL_TASKS}

    assert {ID, "selfmodel/Hexapod-walk-v0", "selfmodel/suite-dog-fetch-v0"} < ids
    assert ids | {FILE_ID} == {name for name in gymnasium.registry if name.startswith("selfmodel/")}
    before = dict(gymnasium.registry)
    register()
    assert dict(gymnasium.registry) == before


def test_a_seed_is_one_sequence_of_episodes_whatever_came_before(env: gymnasium.Env):
    other = gymnasium.make(ID, **RANDOM, time_limit=0.05)
    other.reset()
    firsts = [one.reset(seed=1)[0] for one in (env, other)]
    nexts = [one.reset()[0] for one in (env, other)]

    assert same(*firsts)
    assert same(*nexts)
    assert not same(firsts[0], nexts[0])
    assert not same(firsts[0], env.reset(seed=2)[0])


def test_the_time_limit_truncates_and_the_end_of_a_task_terminates(env: gymnasium.Env):
    env.reset(seed=0)
    action = np.zeros(env.action_space.shape)
    ends = [env.step(action)[2:4] for _ in range(5)]

    assert ends == [(False, False)] * 4 + [(False, True)]
    with pytest.raises(gymnasium.error.ResetNeeded, match="the episode is over"):
        env.step(action)
    env.reset()
    assert env.step(action)[2:4] == (False, False)
    done = gymnasium.make("selfmodel/suite-lqr-lqr_2_1-v0").unwrapped
    done.reset(seed=0)
    task = done._environment.task
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(task, "get_termination", lambda _: 0.0)
        assert done.step(np.zeros(1))[2:4] == (True, False)


def test_a_spec_and_a_copy_make_the_same_environment(env: gymnasium.Env):
    spec = EnvSpec.from_json(env.spec.to_json())
    first = env.reset(seed=4)[0]
    for other in (gymnasium.make(spec), copy.deepcopy(env)):
        assert same(other.reset(seed=4)[0], first)
        other.close()


@pytest.mark.parametrize("mode", ["sync", pytest.param("async", marks=pytest.mark.process)])
def test_a_vector_of_environments_is_that_many_single_ones(mode: str):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # fork in a process with threads
        many = gymnasium.make_vec(ID, num_envs=2, vectorization_mode=mode, start_noise=0.05)
        observations, _ = many.reset(seed=[1, 2])
        many.step(many.action_space.sample())
        many.close()
    single = gymnasium.make(ID, start_noise=0.05)
    for row, seed in enumerate((1, 2)):
        alone = single.reset(seed=seed)[0]
        for name, values in alone.items():
            np.testing.assert_array_equal(observations[name][row], values)


def test_wrong_arguments_are_refused():
    with pytest.raises(gymnasium.error.Error, match="give the seed to reset"):
        gymnasium.make(ID, random=1)
    with pytest.raises(InputError, match="unknown argument of the task 'gaps': did you mean gap"):
        gymnasium.make(ID, gaps=0.05)
    with pytest.raises(InputError, match="unknown part in the term 'break:knee'"):
        gymnasium.make(ID, hypothesis="break:knee")
    with pytest.raises(InputError, match=r"unknown task of .*ant\.xml 'run'"):
        gymnasium.make(FILE_ID, robot=str(ANT), task="run")


CLEAN = """
import sys
import selfmodel, selfmodel.tasks
selfmodel.Settings
assert not {"gymnasium", "shimmy"} & set(sys.modules)
import gymnasium
env = gymnasium.make("selfmodel.tasks.gymnasium_env:selfmodel/Quadruped-walk-v0")
assert env.reset(seed=0)
"""


@pytest.mark.process
def test_selfmodel_does_not_import_gymnasium_and_an_id_may_name_the_module():
    subprocess.run([sys.executable, "-c", CLEAN], check=True)


DRAWN = """
import gymnasium, numpy as np, os, warnings
from gymnasium.utils.env_checker import check_env
import selfmodel.tasks.gymnasium_env

warnings.simplefilter("error")
for name in ("Quadruped-walk", "suite-walker-walk"):
    env = gymnasium.make(f"selfmodel/{name}-v0", render_mode="rgb_array", height=48, width=64)
    check_env(env.unwrapped)
    env.reset(seed=0)
    assert env.render().shape == (48, 64, 3)
    assert np.ptp(env.render()) > 100
print("seen", flush=True)
os._exit(0)  # skips OpenGL's cleanup at exit, whose order is undefined
"""


@pytest.mark.opengl
@pytest.mark.parametrize("chosen", [True, False], ids=["chosen", "as after load_robot"])
def test_pictures_pass_gymnasiums_checks(gl: str, monkeypatch: pytest.MonkeyPatch, *, chosen: bool):
    monkeypatch.setenv("MUJOCO_GL", gl if chosen else "disable")
    done = subprocess.run(
        [sys.executable, "-c", DRAWN], capture_output=True, text=True, check=False, timeout=300
    )

    assert done.stdout.endswith("seen\n"), done.stderr


WRAPPED = [
    ("quadruped", "walk", {"hypothesis": "break:front_left_knee", "gap": 0.05}),
    ("suite-walker", "walk", {"hypothesis": "break:left_ankle", "start_noise": 0.05}),
]


@pytest.mark.bodies
@pytest.mark.parametrize(("domain", "task", "kwargs"), WRAPPED)
def test_gymnasiums_checks_pass_through_shimmy_whose_seed_is_that_of_the_episodes(
    domain: str, task: str, kwargs: dict
):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about environments that it cannot register
        shimmy = importlib.import_module("shimmy")
    wrapped = shimmy.DmControlCompatibilityV0(tasks.load(domain, task, {**kwargs, "random": 0}))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(wrapped, skip_render_check=True)

    # Shimmy's spaces have no bounds where dm_control's specs have none.
    assert not [each for each in caught if "infinity" not in str(each.message)]
    firsts = [wrapped.reset(seed=seed)[0] for seed in (1, 1, 2)]
    for name, values in firsts[0].items():
        np.testing.assert_array_equal(values, firsts[1][name], name)
    assert any(not np.array_equal(values, firsts[2][name]) for name, values in firsts[0].items())
