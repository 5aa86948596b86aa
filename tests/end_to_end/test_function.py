"""Journeys of a robot whose policy is a function of Python: trials, logs, diagnoses, recoveries."""

from pathlib import Path

import numpy as np
import pytest

import selfmodel
from selfmodel import tasks
from selfmodel.errors import InputError, TrialError
from selfmodel.logs import read_log
from selfmodel.robot.robot import Robot
from selfmodel.trials.signals import SIGNALS
from tests.helpers.bench import CONTROLLER, STEPS, Bench, bench_robot
from tests.helpers.command import SMALL, printed, refused, succeeds
from tests.helpers.policies import POLICY, policy_of

DAMAGE = "break:back_left_knee"
TRIAL = ("trial", "quadruped", "--steps", "50", "--damage", DAMAGE)
MODULE = """
import numpy as np

with np.load({network!r}) as file:
    NETWORK = dict(file)


def walk(seen):
    hidden = np.tanh(NETWORK["weight0"] @ seen + NETWORK["bias0"])
    return NETWORK["weight1"] @ hidden + NETWORK["bias1"]


def short(seen):
    return walk(seen)[:3]


def broken(seen):
    raise RuntimeError("no model")


NUMBER = 5
"""


@pytest.fixture
def module(tmp_path: Path, quadruped: Robot, monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of a module with the network of ``network.npz`` as a function."""
    policy_of(tmp_path, quadruped)
    name = f"own_policy_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(MODULE.format(network=str(tmp_path / "network.npz")))
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "own.toml").write_text(POLICY.replace("network.npz", f"{name}:walk"))
    return name


def test_a_function_drives_a_trial_as_its_network_does_and_its_log_has_the_commands(
    tmp_path: Path, module: str
):
    for name in ("policy", "own"):
        run = ("--controller", f"{name}.toml", "--out", f"{name}.mcap")
        succeeds(*TRIAL, *run, cwd=tmp_path)
    policy, own = (read_log(tmp_path / f"{name}.mcap").trial for name in ("policy", "own"))

    for signal in SIGNALS:
        found, expected = own.trajectory[signal], policy.trajectory[signal]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)
    assert own.plan.controller.function == f"{module}:walk"
    told = succeeds("logs", "info", "own.mcap", cwd=tmp_path).stdout
    assert f"the function {module}:walk; its commands are played back" in " ".join(told.split())
    assert printed("replay", "own.mcap", "--hypothesis", DAMAGE, "--json", cwd=tmp_path)[
        "identical"
    ]
    run = ("trial", "quadruped", "--controller", "own.mcap", "--out", "new.mcap")
    refused(*run, said="has recorded commands and no controller", cwd=tmp_path)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (
            "short",
            "own.toml does not fit quadruped: the function {}:short returns float64 numbers of",
        ),
        ("broken", "the function {}:broken failed: RuntimeError: no model"),
        ("NUMBER", "expected a function as {}:NUMBER, got 5"),
        ("wlak", "cannot find the function '{}:wlak'"),
    ],
)
def test_a_wrong_function_is_named_before_the_robot_moves(
    tmp_path: Path, module: str, function: str, said: str
):
    path = tmp_path / "own.toml"
    path.write_text(path.read_text().replace(":walk", f":{function}"))
    run = ("--controller", "own.toml", "--out", "own.mcap")
    refused(*TRIAL, *run, said=said.format(module), cwd=tmp_path)
    assert not list(tmp_path.glob("own.mcap*"))


def test_logs_of_a_function_are_diagnosed_by_their_commands_and_not_by_whole_trials(
    tmp_path: Path, module: str
):
    for name, damage in (("before", "intact"), ("after", DAMAGE)):
        run = ("--controller", "own.toml", "--steps", "60", "--stage", name, "--damage", damage)
        succeeds("trial", "quadruped", *run, "--out", f"{name}.mcap", cwd=tmp_path)
    run = ("diagnose", "after.mcap", "before.mcap", *SMALL, "--no-calibrate", "--kinds", "break")
    found = printed(*run, "--json", cwd=tmp_path)
    why = f"commands of the function {module}:walk, which do not react"

    assert found["diagnosis"][0]["hypothesis"] == DAMAGE
    assert found["comparator"] == "segment-prediction"
    for name in ("sensor-series", "noisy-transfer", "forward-displacement"):
        refused(*run, "--comparator", name, said=why, cwd=tmp_path)


@pytest.mark.search
def test_a_recovery_evolves_a_layer_around_a_function_and_writes_its_numbers(
    tmp_path: Path, module: str
):
    run = ("recover", "quadruped", "--case", "1", *SMALL, "--steps", "30", "--trials", "1")
    run = (*run, "--kinds", "break", "--no-calibrate", "--out", "run", "--json")
    run = (*run, "--comparator", "forward-displacement")
    found = printed(*run, "--controller", "own.toml", cwd=tmp_path)
    path = tmp_path / "run" / "trials"
    first = read_log(path / "01-after.mcap").trial

    assert (found["repair"], found["controller"]) == ("compensate", "compensation")
    assert first.plan.controller.function == f"{module}:walk"
    assert f"the function {module}:walk" in (path / "02-recovery.toml").read_text()
    assert [one.name for one in path.glob("*.toml")] == ["02-recovery.toml"]


TERMS = {"observation": [{"term": "gravity"}, {"term": "joint_positions"}]}


def test_a_function_in_python_is_a_controller_everywhere(tmp_path: Path, quadruped: Robot):
    own = selfmodel.load_policy(TERMS, quadruped, lambda seen: 0.4 * seen[0] - seen[3:])
    physical = selfmodel.simulated_robot(quadruped)
    trial = selfmodel.run_trial(physical, own, tmp_path / "a.mcap", robot=quadruped, steps=40)
    env = tasks.load("quadruped", "walk")
    logged = selfmodel.record(env, own, tmp_path / "b.mcap", robot=quadruped, steps=40)
    (episode,) = selfmodel.evaluate(env, own, robot=quadruped, steps=40)
    bench = Bench()
    list(bench_robot(bench).run(own, STEPS))

    assert trial.plan.controller == logged.plan.controller == own
    assert trial.trajectory["commands"].tobytes() == logged.trajectory["commands"].tobytes()
    assert episode.displacement == logged.displacement
    assert selfmodel.replay(tmp_path / "a.mcap", "intact", quadruped).identical
    assert len(bench.commands) == STEPS - 1


def test_a_function_that_fails_in_mid_trial_stops_the_robot(quadruped: Robot):
    def falls_over(seen: np.ndarray) -> np.ndarray:
        if np.abs(seen[:2]).max() > 0.01:
            raise RuntimeError("tilted")
        return np.zeros(8)

    own, bench = selfmodel.load_policy(TERMS, quadruped, falls_over), Bench()
    with pytest.raises(TrialError, match=r"falls_over failed: RuntimeError: tilted"):
        list(bench_robot(bench).run(own, STEPS))
    assert bench.done[-1] == "stop"


@pytest.mark.parametrize("step", [0, 3])
def test_a_function_of_the_environment_s_observation_is_named_where_it_fails(step: int):
    calls = list[int]()

    def fails(_: object) -> np.ndarray:
        calls.append(0)
        return np.full(8, np.nan if len(calls) > step else 0.1)

    bench = Bench()
    kind = TrialError if step else InputError
    with pytest.raises(kind, match=r"fails returns \[nan, .*expected finite numbers"):
        list(bench_robot(bench, policy=fails).run(CONTROLLER, STEPS))
    assert len(bench.commands) == step
    assert bench.done[-1] == "stop"
