"""Journeys of a robot with a policy of its own: trials, logs, replays, hardware, and recoveries."""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from signal import SIGINT, raise_signal

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from selfmodel.arguments import read_controller
from selfmodel.controllers.compensation import Compensated
from selfmodel.controllers.controller import Controller, make_batch
from selfmodel.controllers.graph import Graph
from selfmodel.controllers.policy import Policy
from selfmodel.controllers.trained import Finetuned
from selfmodel.errors import InputError, TrialError
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.logs import read_log, save_controller
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.recovery import RecoveryLoop
from selfmodel.recovery.layers import layered
from selfmodel.recovery.tracking import following
from selfmodel.robot.robot import Robot
from selfmodel.simulation.domain import (
    DomainDistribution,
    StartSpread,
    draw_samples,
    joint_half_ranges,
    measurement_noise,
)
from selfmodel.simulation.model_factors import exact
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.trial_replay import replay
from selfmodel.trials.signals import MEASUREMENT_FULL_SCALES, SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory, collect
from tests.helpers.bench import NAMES, STEPS, Bench, bench_robot, observation
from tests.helpers.command import SMALL, printed, refused, selfmodel, succeeds
from tests.helpers.hostile import unstable
from tests.helpers.policies import (
    POLICY,
    policy_of,
    recurrent_bytes,
    save_layers,
    save_policy,
)
from tests.helpers.robots.arms import arm

DAMAGE = "break:back_left_knee"


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory, quadruped: Robot) -> Controller:
    return policy_of(tmp_path_factory.mktemp("policy"), quadruped)


def echo(folder: Path, robot: Robot, term: str = "joint_positions") -> Controller:
    """A policy whose commands are half of what it observes, of joints those of its motors."""
    hinges, motors = robot.anatomy.names.hinges, robot.anatomy.names.motors
    columns = hinges if term == "joint_positions" else motors[:3]
    weights = np.array([[float(column == motor) for column in columns] for motor in motors])
    text = f'network = "network.npz"\naction.scale = 0.5\n[[observation]]\nterm = "{term}"\n'
    path = save_policy(folder, robot, text)
    save_layers(folder, [(weights, np.zeros(len(motors)))])
    return read_controller(path, robot)


def joints_in_motor_order(values: np.ndarray) -> np.ndarray:
    return values[..., [NAMES.hinges.index(name) for name in NAMES.motors]]


# ---------------------------------------------------------------- trials, logs and replays


def test_a_trial_of_a_policy_file_has_a_log_with_the_policy_that_replays_to_the_bit(
    tmp_path: Path, quadruped: Robot
):
    policy = policy_of(tmp_path, quadruped)
    run = ("--controller", "policy.toml", "--steps", "50", "--damage", DAMAGE)
    succeeds("trial", "quadruped", *run, "--out", "walk.mcap", cwd=tmp_path)
    trial = read_log(tmp_path / "walk.mcap").trial
    hypothesis = parse(DAMAGE, quadruped.anatomy)

    assert trial.plan.controller == policy
    assert isinstance(trial.plan.controller.design, Policy)
    assert replay(trial, hypothesis, Simulator(quadruped, 1)).identical
    assert not replay(trial, INTACT, Simulator(quadruped, 1)).identical
    said = printed("replay", "walk.mcap", "--hypothesis", DAMAGE, "--json", cwd=tmp_path)
    assert said["identical"] is True
    assert (
        "a policy of 35 observations, 8 motors"
        in succeeds("logs", "info", "walk.mcap", cwd=tmp_path).stdout
    )


def test_a_trial_of_a_recurrent_policy_replays_to_the_bit_and_remembers(
    tmp_path: Path, quadruped: Robot
):
    path = save_policy(tmp_path, quadruped, POLICY.replace("npz", "onnx"))
    (tmp_path / "network.onnx").write_bytes(recurrent_bytes("LSTM", 35, 8))
    run = ("--controller", str(path), "--steps", "50")
    succeeds("trial", "quadruped", *run, "--out", "walk.mcap", cwd=tmp_path)
    trial = read_log(tmp_path / "walk.mcap").trial
    graph = trial.plan.controller.design.graph
    without = replace(graph, states=(), tensors={**graph.tensors, **zeros_of(graph)})
    forgets = replace(trial.plan.controller.design, graph=without)
    runs = [(INTACT, Controller(each, np.zeros(0))) for each in (forgets,)]
    again = Simulator(quadruped, 1).run(runs, 50, ["commands"]).trajectory["commands"][0]

    assert replay(trial, INTACT, Simulator(quadruped, 1)).identical
    assert again[0].tobytes() == trial.trajectory["commands"][0].tobytes()
    assert not np.array_equal(again[1:], trial.trajectory["commands"][1:])


def zeros_of(graph: Graph) -> dict[str, np.ndarray]:
    """The states before the first evaluation of a row, as tensors."""
    return {state.input: np.zeros((1, 1, state.width)) for state in graph.states}


def test_the_policy_of_a_log_drives_another_trial(tmp_path: Path, quadruped: Robot):
    policy = policy_of(tmp_path, quadruped)
    for given, out in (("policy.toml", "1.mcap"), ("1.mcap", "2.mcap")):
        run = ("--controller", given, "--steps", "20", "--out", out)
        succeeds("trial", "quadruped", *run, cwd=tmp_path)
    first, second = (read_log(tmp_path / f"{k}.mcap").trial for k in (1, 2))

    assert first.plan.controller == second.plan.controller == policy
    assert all(first.trajectory[s].tobytes() == second.trajectory[s].tobytes() for s in SIGNALS)
    run = ("trial", "hexapod", "--controller", "1.mcap", "--out", "3.mcap")
    refused(*run, said="give a controller of this robot", cwd=tmp_path)


@pytest.mark.parametrize(
    ("design", "interface"),
    [
        ({}, {"hinges": NAMES.hinges[::-1]}),
        ({}, {"timestep": 0.02}),
        ({"ranges": ((0.0, 1.0),) * len(NAMES.motors)}, {}),
    ],
)
def test_a_policy_of_a_robot_that_differs_is_refused(
    tmp_path: Path, quadruped: Robot, policy: Controller, design: dict, interface: dict
):
    own = replace(policy.design.interface, **interface)
    other = Controller(replace(policy.design, interface=own, **design), policy.genome)
    for number, one in enumerate((other, layered(other))):
        path = tmp_path / f"{number}.npz"
        save_controller(path, one)
        with pytest.raises(InputError, match=r"other joints, another command range or time step"):
            read_controller(path, quadruped)


def physical(
    robot: Robot, controller: Controller, level: float, steps: int, seed: int = 0
) -> Trajectory:
    gap = draw_gap(robot, level, np.random.default_rng(seed)) if level else None
    return collect(robot.anatomy.names, SimulatedRobot(robot, gap=gap).run(controller, steps))


@pytest.mark.parametrize("layer", [False, True])
def test_without_a_gap_a_physical_robot_with_a_policy_is_the_simulator_s_to_the_bit(
    robot: Robot, tmp_path: Path, *, layer: bool
):
    driver = policy_of(tmp_path, robot)
    if layer:
        design = Compensated.around(driver, feedback=True)
        driver = Controller(design, np.linspace(-0.3, 0.3, design.weights))
    found = physical(robot, driver, 0.0, 40)
    runs = [(INTACT, driver)] * 3
    simulated = Simulator(robot, 2).run(runs, 40, SIGNALS).trajectory

    assert np.ptp(found["commands"], axis=0).min() > 0.01
    for signal in SIGNALS:
        assert found[signal].tobytes() == simulated[signal][1].tobytes(), signal


def test_a_policy_observes_the_signals_that_the_log_has(tmp_path: Path, quadruped: Robot):
    driver = echo(tmp_path, quadruped)
    trajectory = physical(quadruped, driver, 0.0, 60)
    observed = joints_in_motor_order(trajectory["joint_positions"])

    np.testing.assert_array_equal(trajectory["commands"], 0.5 * observed)


def test_with_a_gap_the_policy_observes_noise_that_is_not_the_log_s(
    tmp_path: Path, quadruped: Robot
):
    level, driver = 0.02, echo(tmp_path, quadruped)
    trajectory = physical(quadruped, driver, level, 300)
    logged = joints_in_motor_order(trajectory["joint_positions"])
    difference = (2 * trajectory["commands"] - logged) / (level * joint_half_ranges(quadruped)[0])

    # Of two independent noises, of the observation and of the log.
    np.testing.assert_allclose(difference.std(axis=0), 2**0.5, rtol=0.15)


def test_a_trial_with_a_gap_is_reproducible_by_its_seed(quadruped: Robot, policy: Controller):
    first, again, other = (physical(quadruped, policy, 0.1, 30, seed) for seed in (1, 1, 2))

    for signal in SIGNALS:
        assert first[signal].tobytes() == again[signal].tobytes()
    assert np.abs(first["commands"] - other["commands"]).min(axis=0).max() > 0


def gravity_of(orientation: np.ndarray) -> np.ndarray:
    """The direction of gravity, forward and to the left, of a base that is nearly level."""
    turn = Rotation.from_quat(orientation.reshape(-1, 4), scalar_first=True).inv()
    return turn.apply((0, 0, -1)).reshape(*orientation.shape[:-1], 3)[..., :2]


@pytest.mark.parametrize(
    ("term", "signal", "true"),
    [
        ("joint_positions", "joint_positions", joints_in_motor_order),
        ("gravity", "base_orientation", gravity_of),
        ("angular_velocity", "base_angular_velocity", lambda values: values),
    ],
)
def test_under_uncertainty_the_noise_of_a_condition_is_common_to_all_policies(
    tmp_path: Path,
    quadruped: Robot,
    term: str,
    signal: Signal,
    true: Callable[[np.ndarray], np.ndarray],
):
    nothing, level = np.zeros(len(NAMES.sensors)), 0.01
    unknown = DomainDistribution(exact(quadruped), nothing + level, nothing, StartSpread(0, 0))
    drawn = draw_samples((INTACT,), unknown, 3, np.random.default_rng(0))
    own = echo(tmp_path, quadruped, term)
    simulator = Simulator(quadruped, 2)
    outcome = simulator.run_under(drawn, unknown, [own] * 2, 200, ("commands", signal)).trajectory
    scale = MEASUREMENT_FULL_SCALES.get(signal, joint_half_ranges(quadruped)[0])
    expected = true(outcome[signal])
    observed = 2 * outcome["commands"][..., : expected.shape[-1]]
    noise = (observed - expected) / (level * scale)

    assert outcome["commands"][0].tobytes() == outcome["commands"][1].tobytes()
    np.testing.assert_allclose(noise[0].std(axis=1), 1.0, rtol=0.2)
    assert np.abs(np.corrcoef(noise[0].reshape(3, -1)) - np.eye(3)).max() < 0.15


def test_the_pose_of_a_fixed_base_is_observed_without_noise():
    robot, noise = arm(), np.full(len(arm().anatomy.names.sensors), 0.1)
    unknown = DomainDistribution(exact(robot), noise, 0 * noise, StartSpread(0, 0))
    drawn = draw_samples((INTACT,), unknown, 2, np.random.default_rng(0))
    variants = [condition.variant(robot) for condition in drawn]
    level = np.tile([1.0, 0, 0, 0], (2, 1))
    joints = np.zeros((2, len(robot.anatomy.names.hinges)))
    observed = {"base_orientation": level.copy(), "joint_velocities": joints}
    measurement_noise(robot, variants, drawn, unknown)(np.zeros((2, len(noise))), observed)

    np.testing.assert_array_equal(observed["base_orientation"], level)
    assert joints.all()


def test_a_simulation_with_a_policy_that_diverges_is_no_warning(
    quadruped: Robot, policy: Controller
):
    stormy = unstable(quadruped)
    assert Simulator(stormy, 1).run([(INTACT, policy)], 20, SIGNALS).diverged.all()


# ---------------------------------------------------------------- a robot behind an environment


def driven(bench: Bench, controller: Controller) -> Trajectory:
    return collect(NAMES, bench_robot(bench).run(controller, STEPS))


GONE = {"base_orientation": None, "joint_velocities": np.array([0.1, np.nan, *[0.3] * 6])}


def test_a_policy_goes_on_with_the_signals_that_it_had(policy: Controller):
    happens = {7: None, 8: None, 15: observation(15, **GONE), 16: observation(16, **GONE)}
    found = driven(Bench(happens), policy)
    brain = make_batch([policy], [frozenset()], len(NAMES.sensors))
    commands = np.empty((1, len(NAMES.motors)))

    assert np.isnan(found["base_orientation"][[7, 8, 15, 16]]).all()
    for k in range(STEPS):
        told = observation(6 if k in (7, 8) else k)
        for at in (15, 16):
            if k == at:
                last = observation(14)
                told["base_orientation"] = last["base_orientation"]
                told["joint_velocities"] = GONE["joint_velocities"].copy()
                told["joint_velocities"][1] = last["joint_velocities"][1]
        brain.readings[0] = told["sensors"]
        for signal, rows in brain.observed.items():
            rows[0] = told[signal]
        brain.step(commands)
        assert found["commands"][k].tobytes() == commands[0].tobytes(), k


@pytest.mark.parametrize("signal", ["base_orientation", "joint_velocities", "joint_positions"])
def test_a_robot_that_stops_to_deliver_what_its_policy_observes_is_stopped(
    policy: Controller, signal: str
):
    bench = Bench({k: observation(k, **{signal: None}) for k in range(9, 15)})
    match = rf"no reading of {signal} .* the controller requires, for more than 5 steps, at step 14"
    with pytest.raises(TrialError, match=match):
        driven(bench, policy)
    assert bench.done[-2:] == ["step", "stop"]
    assert len(bench.commands) == 14
    bench = Bench({0: observation(0, **{signal: None})})
    with pytest.raises(TrialError, match=rf"no reading of {signal} .* at step 0"):
        driven(bench, policy)


def test_a_signal_that_the_policy_does_not_observe_may_be_missing(policy: Controller):
    assert not policy.design.reads
    unneeded = [s for s in SIGNALS if s not in (*policy.design.observes, "commands")]
    absent = {k: observation(k, **dict.fromkeys(unneeded)) for k in range(STEPS)}

    assert unneeded
    assert np.isfinite(driven(Bench(absent), policy)["commands"]).all()


def test_a_robot_whose_orientation_is_no_rotation_is_stopped(policy: Controller):
    bench = Bench({9: observation(9, base_orientation=np.zeros(4))})
    with pytest.raises(TrialError, match=r"base_orientation must be a unit quaternion.* at step 9"):
        driven(bench, policy)


def test_a_robot_is_not_sent_commands_that_are_not_finite(tmp_path: Path, quadruped: Robot):
    text = 'network = "network.npz"\nlast = "Sqrt"\n[[observation]]\nterm = "sensors"\n'
    path = save_policy(tmp_path, quadruped, text)
    save_layers(tmp_path, [(np.eye(8), np.zeros(8))])
    positive = {k: observation(k, sensors=np.full(8, 0.25)) for k in range(5)}
    bench = Bench({**positive, 5: observation(5, sensors=np.full(8, -0.25))})
    with pytest.raises(TrialError, match="the controller's commands are not finite at step 5"):
        driven(bench, read_controller(path, quadruped))
    assert np.isfinite(bench.commands).all()
    assert bench.done[-2:] == ["step", "stop"]


# ---------------------------------------------------------------- recoveries

RECOVER = (
    *("recover", "quadruped", "--case", "1", *SMALL, "--steps", "30", "--trials", "1"),
    *("--comparator", "forward-displacement", "--kinds", "paper", "--no-calibrate"),
    *("--diagnostic-search", "ea"),
    *("--gap", "0.05", "--out", "run", "--json"),
)


@pytest.mark.search
def test_a_recovery_of_a_policy_is_scored_by_the_velocity_that_it_is_commanded(
    tmp_path: Path, quadruped: Robot
):
    policy_of(tmp_path, quadruped, "velocity = [0.2, 0.0, 0.0]\n" + POLICY)
    found = printed(*RECOVER, "--controller", "policy.toml", "--score", "velocity", cwd=tmp_path)
    trial = read_log(tmp_path / found["trials"][0]["log"]).trial

    assert found["score"]["name"] == "velocity"
    assert 0 < found["score"]["before"] == following((0.2, 0, 0)).of_trial(quadruped, INTACT, trial)
    refused(*RECOVER, "--score", "velocity", said="give --controller policy.toml", cwd=tmp_path)


def before(folder: Path, patch: pytest.MonkeyPatch, *options: str) -> Controller:
    """Returns the controller before the failure of a recovery in ``again``, which ends there."""
    patch.setattr(RecoveryLoop, "_diagnose", lambda *_: raise_signal(SIGINT))
    assert selfmodel(*RECOVER, *options, "--out", "again", cwd=folder).returncode == 130
    return read_log(folder / "again" / "trials" / "00-before.mcap").trial.plan.controller


def test_a_recovery_keeps_the_policy_and_evolves_a_layer_around_it(
    tmp_path: Path, quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    policy = policy_of(tmp_path, quadruped)
    found = printed(*RECOVER, "--controller", "policy.toml", cwd=tmp_path)
    drivers = [read_log(tmp_path / trial["log"]).trial.plan.controller for trial in found["trials"]]

    assert found["repair"] == "compensate"
    assert found["controller"] == "compensation"
    assert [trial["stage"] for trial in found["trials"]] == ["before", "after", "recovery"]
    assert all(isinstance(driver.design, Compensated) for driver in drivers)
    assert {driver.design.base for driver in drivers} == {policy}
    assert not any(driver.genome.any() for driver in drivers[:2]), "the policy as it is"

    repaired = ("--controller", found["trials"][2]["log"])
    assert before(tmp_path, monkeypatch, *repaired) == drivers[2]


def test_a_recovery_fine_tunes_the_last_layer_of_a_policy(
    tmp_path: Path, quadruped: Robot, monkeypatch: pytest.MonkeyPatch
):
    policy = policy_of(tmp_path, quadruped)
    options = ("--controller", "policy.toml", "--repair", "finetune", "--seed", "1")
    found = printed(*RECOVER, *options, cwd=tmp_path)
    logs = [tmp_path / trial["log"] for trial in found["trials"]]
    healthy, _, last = (read_log(path).trial.plan.controller for path in logs)

    assert (found["repair"], found["controller"]) == ("finetune", "policy")
    assert healthy == policy
    assert isinstance(last.design, Finetuned)
    assert last.design.graph == policy.design.graph
    assert last.genome.any()
    numbers = tomllib.loads(logs[2].with_suffix(".toml").read_text())
    changed = last.design.policy(last.genome).graph.tensors[numbers["tensor"]]
    change = changed - policy.design.graph.tensors[numbers["tensor"]]
    np.testing.assert_allclose(numbers["change"], change)
    walk = ("--controller", found["trials"][2]["log"], "--steps", "30", "--out", "walk.mcap")
    succeeds("trial", "quadruped", *walk, cwd=tmp_path)
    assert printed("replay", "walk.mcap", "--json", cwd=tmp_path)["identical"] is True

    repaired = ("--controller", found["trials"][2]["log"])
    assert before(tmp_path, monkeypatch, *repaired, "--repair", "finetune") == last
    refused(*RECOVER, "--repair", "finetune", said="needs a controller", cwd=tmp_path)
