"""Promises of prediction: from logged states it makes the trial again, late commands and all."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest

from selfmodel import arguments, load_robot
from selfmodel.controllers.controller import CommandSource
from selfmodel.controllers.playback import played_back
from selfmodel.errors import InputError
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.physical.simulated import SimulatedRobot, draw_gap
from selfmodel.robot.robot import Robot
from selfmodel.rotation import rotation_between
from selfmodel.simulation import prediction
from selfmodel.simulation.prediction import activations, predict
from selfmodel.simulation.requests import END, MAX_CHAIN, WARM_UP, Segments, chained, cut_segments
from selfmodel.simulation.rollout import SimulationStats
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.estimation import JOINTS, ONBOARD, STATE
from selfmodel.trials.signals import SIGNALS, Signal
from selfmodel.trials.trajectory import Trajectory, collect
from tests.helpers.calibration import late
from tests.helpers.drivers import random_motion
from tests.helpers.hostile import exploding

HORIZON, STEPS = 12, 100
RECORD: tuple[Signal, ...] = (*STATE, "sensors")
EXACT = 1e-6
STARTS, CHAIN = range(0, STEPS - HORIZON, 15), range(0, STEPS - HORIZON, HORIZON)


def moved(robot: Robot, steps: int = STEPS) -> CommandSource:
    """A driver that moves every joint."""
    return played_back(robot.anatomy.motors, random_motion(robot, steps))


def trials(robot: Robot, *hypotheses: Hypothesis) -> list[Trajectory]:
    """One run without noise under each hypothesis."""
    runs = [(hypothesis, moved(robot)) for hypothesis in hypotheses]
    batch = Simulator(robot, 1).run(runs, STEPS, SIGNALS).trajectory
    return [batch.run(number) for number in range(len(runs))]


def cut(
    run: Trajectory, starts: Sequence[int] = STARTS, signals: tuple[Signal, ...] = STATE
) -> Segments:
    states = {signal: run[signal] for signal in signals}
    return cut_segments(run, states, np.array(starts), HORIZON, RECORD)


def error(predicted: Trajectory, run: Trajectory, starts: Sequence[int] = STARTS) -> float:
    """By how much the first of the models is wrong anywhere."""
    worst = 0.0
    for signal in STATE:
        logged = np.stack([run[signal][k : k + HORIZON + 1] for k in starts])
        own = predicted[signal][0]
        apart = rotation_between(own, logged) if signal == "base_orientation" else own - logged
        worst = max(worst, float(np.abs(apart).max()))
    return worst


def test_every_single_fault_is_predicted_as_it_was(robot: Robot):
    faults = [fault for kind in PAPER_KINDS for fault in kind.candidates(robot.anatomy)[::3]]
    hypotheses = [INTACT, *(canonical([fault], robot.anatomy) for fault in faults)]
    simulator = Simulator(robot, 1)

    assert {fault.kind.name for fault in faults} == {"break", "jam", "sensor"}
    for hypothesis, run in zip(hypotheses, trials(robot, *hypotheses), strict=True):
        outcome = simulator.predict([hypothesis], cut(run))
        assert error(outcome.trajectory, run) < EXACT, str(hypothesis)
        assert not outcome.diverged.any()
        if hypothesis != INTACT and "sensor" not in str(hypothesis):
            assert error(simulator.predict([INTACT], cut(run)).trajectory, run) > 0.01


def test_a_jammed_joint_begins_where_it_is_held(quadruped: Robot):
    (run,) = trials(quadruped, INTACT)
    jammed = parse("jam:front_left_knee=0.3", quadruped.anatomy)
    outcome = Simulator(quadruped, 1).predict([jammed], cut(run, [20, 40]))
    knee = quadruped.anatomy.hinges.index("front_left_knee")

    np.testing.assert_allclose(outcome.trajectory["joint_positions"][..., knee], 0.3, atol=EXACT)
    np.testing.assert_allclose(outcome.trajectory["joint_velocities"][..., knee], 0, atol=1e-4)
    assert outcome.trajectory.hinge_mask("welded")[0].tolist() == [k == knee for k in range(8)]


@pytest.mark.parametrize("signals", [STATE, ONBOARD], ids=["whole", "onboard"])
def test_the_joints_of_a_lost_limb_rest_where_noise_hides_them(
    robot: Robot, signals: tuple[Signal, ...]
):
    anatomy = robot.anatomy
    joint = anatomy.joints[0]
    broken = parse(f"break:{joint.name}", anatomy)
    segments = cut(*trials(robot, broken), signals=signals)
    noise = np.random.default_rng(0).normal(0.2, 0.1, segments.states["joint_positions"].shape)
    shifted = segments.states["joint_positions"] + noise
    noisy = {**segments.states, "joint_positions": shifted, "joint_velocities": shifted}
    shaken = dataclasses.replace(segments, states=noisy)
    predicted = Simulator(robot, 1).predict([INTACT, broken], shaken).trajectory
    beyond = [joint, *(other for other in anatomy.joints if other.name in joint.descendants)]
    lost = [anatomy.hinges.index(hinge) for each in beyond for hinge in each.hinges]
    positions = predicted["joint_positions"][..., lost]

    last_third = shifted[round((1 - END) * len(shifted)) :, lost]
    expected = np.broadcast_to(np.median(last_third, axis=0), positions[1].shape)
    np.testing.assert_allclose(positions[1], expected)
    np.testing.assert_array_equal(predicted["joint_velocities"][1][..., lost], 0)
    assert len(beyond) > 1
    np.testing.assert_allclose(positions[0, :, 0], shifted[:, lost])
    assert np.flatnonzero(predicted.hinge_mask("detached")[1]).tolist() == sorted(lost)


def test_the_encoder_of_a_lost_limb_reads_its_angle_in_a_recording_and_0_in_our_own_trials(
    robot: Robot,
):
    anatomy = robot.anatomy
    broken = parse(f"break:{anatomy.joints[0].name}", anatomy)
    segments = cut(*trials(robot, broken))
    angles = np.full_like(segments.states["joint_positions"], 0.3)
    frozen = dataclasses.replace(segments, states={**segments.states, "joint_positions": angles})
    read, zero = (
        Simulator(robot, 1).predict([broken], dataclasses.replace(frozen, reads_encoders=reads))
        for reads in (True, False)
    )
    lost = read.trajectory.hinge_mask("detached")[0]
    sensors = [
        (column, sensor.reading(0.3))
        for column, sensor in enumerate(anatomy.sensors)
        if sensor.hinge and lost[anatomy.hinges.index(sensor.hinge)]
    ]

    assert sensors
    for column, reading in sensors:
        np.testing.assert_allclose(read.trajectory["sensors"][..., column], reading)
        np.testing.assert_array_equal(zero.trajectory["sensors"][..., column], 0)


def test_a_lost_limb_rests_wherever_it_starts():
    # The hopper's knee starts beyond its limit, which would push it all through the trial.
    robot = arguments.robot_entry("suite-hopper-hop").robot()
    broken = parse("break:knee", robot.anatomy)
    (run,) = trials(robot, broken)
    knee = robot.anatomy.hinges.index("knee")

    assert run["joint_positions"][0, knee] < robot.anatomy.joint("knee").limits[0][0]
    assert error(Simulator(robot, 1).predict([broken], cut(run)).trajectory, run) < EXACT


@pytest.mark.parametrize("delay", [0.5, 1.5, 4.5, 5])
def test_a_delay_is_the_same_in_a_run_a_prediction_and_a_physical_robot(
    quadruped: Robot, delay: float
):
    slow, prompt = late(quadruped, delay), late(quadruped, 0)
    (run,) = trials(slow, INTACT)
    exact = collect(slow.anatomy.names, SimulatedRobot(slow).run(moved(slow), STEPS))

    def prediction_error(robot: Robot, steps: float | None) -> float:
        built, stats = [build(robot, INTACT)], SimulationStats()
        predicted = predict(robot, built, cut(run), threads=1, stats=stats, delay=steps)
        return error(predicted.trajectory, run)

    assert slow.control_delay == delay
    for signal in SIGNALS:
        assert exact[signal].tobytes() == run[signal].tobytes(), signal
    assert prediction_error(slow, None) < 1e-9
    assert prediction_error(prompt, delay) < EXACT
    assert prediction_error(prompt, None) > 0.01


def test_a_delay_of_the_reality_gap_is_that_of_the_model(quadruped: Robot):
    delay = 5
    (run,) = trials(late(quadruped, delay), INTACT)
    gap = draw_gap(quadruped, 0.0, np.random.default_rng(0))
    gap = dataclasses.replace(gap, level=1e-12, delay=delay)
    physical = SimulatedRobot(late(quadruped, 0), gap=gap)
    observed = collect(quadruped.anatomy.names, physical.run(moved(quadruped), STEPS))

    for signal in set(SIGNALS) - {"sensors"}:  # a touch may come a step later
        np.testing.assert_allclose(observed[signal], run[signal], atol=1e-5, err_msg=signal)


STOOL = """
<mujoco model="stool"><worldbody>
  <geom type="plane" size="0 0 1"/>
  <body name="seat" pos="0 0 .3"><freejoint/><geom type="box" size=".2 .1 .05" mass="2"/>
    <body name="front" pos=".15 0 0"><joint name="front" axis="0 1 0" range="-90 90"/>
      <geom type="box" pos="0 0 -.15" size=".02 .1 .1" mass=".2"/></body>
    <body name="back" pos="-.15 0 0"><joint name="back" axis="0 1 0" range="-90 90"/>
      <geom type="box" pos="0 0 -.15" size=".02 .1 .1" mass=".2"/></body></body>
</worldbody><actuator>
  <position name="front" joint="front" kp="50" kv="1" ctrlrange="-1.5 1.5"/>
  <position name="back" joint="back" kp="50" kv="1" ctrlrange="-1.5 1.5"/>
</actuator><keyframe><key name="stand" qpos="0 0 .28 1 0 0 0 .4 -.4"/></keyframe></mujoco>
"""


def test_until_the_first_command_arrives_servos_hold_the_stance(tmp_path: Path):
    (tmp_path / "stool.xml").write_text(STOOL)
    slow = late(load_robot(tmp_path / "stool.xml"), 5)
    stance = np.tile([0.4, -0.4], (STEPS, 1))
    still = played_back(slow.anatomy.motors, stance)
    batch = Simulator(slow, 1).run([(INTACT, still)], STEPS, SIGNALS).trajectory
    run = Trajectory(batch.names, batch.time, {signal: batch[signal][0] for signal in SIGNALS})

    np.testing.assert_allclose(run["joint_positions"], stance, atol=0.05)
    predicted = Simulator(slow, 1).predict([INTACT], cut(run)).trajectory
    assert error(predicted, run) < EXACT


def test_without_the_base_a_segment_goes_on_where_the_one_before_it_ended(robot: Robot):
    (run,) = trials(robot, INTACT)
    outcome = Simulator(robot, 1).predict([INTACT, INTACT], cut(run, CHAIN, ONBOARD))
    base = outcome.trajectory["base_position"]

    assert base[:, 1:, 0].tobytes() == base[:, :-1, -1].tobytes()
    # What was logged is what was predicted, so the whole chain is the trial.
    assert error(outcome.trajectory, run, CHAIN) < 10 * EXACT


def test_chains_are_predicted_together_as_each_is_alone(quadruped: Robot):
    (run,), simulator = trials(quadruped, INTACT), Simulator(quadruped, 1)
    parts = [[0, 12, 24], [50, 62, 74]]
    both = dataclasses.replace(cut(run, [*parts[0], *parts[1]], ONBOARD), chains=2)
    together = simulator.predict([INTACT], both).trajectory
    for part, rows in zip(parts, (slice(0, 3), slice(3, 6)), strict=True):
        alone = simulator.predict([INTACT], cut(run, part, ONBOARD)).trajectory
        for signal in RECORD:
            assert together[signal][:, rows].tobytes() == alone[signal].tobytes(), signal


@pytest.mark.parametrize("chains", [0, 4])
def test_segments_that_no_chains_of_equal_length_make_up_are_refused(chains: int):
    with pytest.raises(InputError, match=f"expected chains of equal length: 3 segments, {chains}"):
        Segments({}, np.zeros((9, 2)), np.arange(3), 2, JOINTS, chains)


@pytest.mark.parametrize("length", [0.024, 0.06, 0.12, 0.24, 2.0])
@pytest.mark.parametrize(("count", "most"), [(80, 80), (125, 125), (2500, 2500), (125, 26), (9, 8)])
def test_chains_count_each_segment_once_and_warm_up_where_they_begin_in_mid_trial(
    count: int, most: int, length: float
):
    rows, counted, chains = chained(count, most, length)
    parts, warm_up = np.split(rows, chains), max(1, round(WARM_UP / length))

    assert len(rows) <= max(1.25 * most, 4 * warm_up)
    assert len(set(rows[counted].tolist())) == counted.sum()
    if count <= most:
        assert len(parts[0]) * length <= MAX_CHAIN
        np.testing.assert_array_equal(rows[counted], np.arange(count))
    assert rows[-1] == count - 1  # a fault may begin during the trial
    if count * length > MAX_CHAIN:
        assert rows[0] == 0  # and what was before it is compared with what is after it
    for part, used in zip(parts, np.split(counted, chains), strict=True):
        np.testing.assert_array_equal(np.diff(part), 1)
        assert part[0] == 0 or not used[:warm_up].any()


@pytest.mark.parametrize("signals", [STATE, ONBOARD], ids=["whole", "onboard"])
def test_a_prediction_has_the_same_bits_in_any_batch_and_number_of_threads(
    quadruped: Robot, signals: tuple[Signal, ...], monkeypatch: pytest.MonkeyPatch
):
    robot = quadruped
    joints = [joint.name for joint in robot.anatomy.joints]
    texts = ("intact", f"break:{joints[0]}", f"jam:{joints[1]}=0.2", f"break:{joints[-1]}")
    hypotheses = [parse(text, robot.anatomy) for text in texts]
    segments = cut(*trials(robot, INTACT), range(0, STEPS - HORIZON, 20), signals)

    def bits(chosen: Sequence[Hypothesis], threads: int) -> list[bytes]:
        predicted = Simulator(robot, threads).predict(chosen, segments).trajectory
        return [b"".join(predicted[s][i].tobytes() for s in RECORD) for i in range(len(chosen))]

    expected = bits(hypotheses, 1)

    assert len(set(expected)) == len(hypotheses)
    assert bits(hypotheses, 3) == expected
    assert bits(hypotheses[::-1], 2) == expected[::-1]
    assert [bits([one], 2)[0] for one in hypotheses] == expected
    monkeypatch.setattr(prediction, "CHUNK_BYTES", 1)  # a control step at a time
    assert bits(hypotheses, 1) == expected


def test_a_whole_state_is_predicted_alike_in_any_choice_of_segments(quadruped: Robot):
    (run,), simulator = trials(quadruped, INTACT), Simulator(quadruped, 2)
    together = simulator.predict([INTACT], cut(run, [0, 30, 60])).trajectory
    for place, start in enumerate([0, 30, 60]):
        alone = simulator.predict([INTACT], cut(run, [start])).trajectory
        for signal in RECORD:
            assert alone[signal][0, 0].tobytes() == together[signal][0, place].tobytes()


def test_a_prediction_that_diverges_is_flagged_counted_and_alone(quadruped: Robot):
    segments = cut(*trials(quadruped, INTACT), [0, 30, 60])
    expected = Simulator(quadruped, 1).predict([INTACT], segments).trajectory
    simulator = Simulator(quadruped, 1)
    bad = exploding(simulator, "jam:front_left_knee=0.1")
    outcome = simulator.predict([bad, INTACT], segments)

    assert outcome.diverged.tolist() == [True, False]
    assert (simulator.stats.runs, simulator.stats.diverged) == (2, 1)
    assert simulator.stats.steps == 2 * 3 * HORIZON
    for signal in RECORD:
        assert outcome.trajectory[signal][1].tobytes() == expected[signal][0].tobytes()


def unknown(segments: Segments, column: int) -> Segments:
    """The segments, with an encoder that was lost."""
    states = {signal: values.copy() for signal, values in segments.states.items()}
    for signal in JOINTS:
        states[signal][:, column] = np.nan
    return dataclasses.replace(segments, states=states)


@pytest.mark.parametrize("text", ["intact", "break:front_left_knee"])
def test_an_unknown_hinge_continues_from_the_segment_before(quadruped: Robot, text: str):
    hypothesis = parse(text, quadruped.anatomy)
    (run,) = trials(quadruped, hypothesis)
    column = run.names.hinges.index("front_left_knee")
    predicted = Simulator(quadruped, 1).predict([hypothesis], unknown(cut(run, CHAIN), column))

    if hypothesis == INTACT:
        assert error(predicted.trajectory, run, CHAIN) < EXACT
        return
    # The hinge of a lost limb needs no known angle, and moves nothing else.
    found, logged = (own["joint_positions"] for own in (predicted.trajectory, run))
    assert np.all(found[0, :, 0, column] == 0)
    apart = found[0, :, -1] - logged[np.array(CHAIN) + HORIZON]
    assert np.abs(np.delete(apart, column, axis=1)).max() < EXACT


FILTERS = """
<mujoco>
  <option timestep="0.005" integrator="{integrator}"/>
  <default><general gear="1e-3"/></default>
  <worldbody>
    <body name="torso" pos="0 0 1">
      <freejoint/>
      <geom size=".1"/>
      <body name="leg"><joint name="hip" range="-1 1" axis="0 1 0"/><geom size=".1"/></body>
    </body>
  </worldbody>
  <actuator>
    <general name="plain" joint="hip"/>
    <general name="slow" joint="hip" dyntype="filter" dynprm=".1" ctrlrange="-1 .5"/>
    <general name="exact" joint="hip" dyntype="filterexact" dynprm=".02"/>
    <general name="bound" joint="hip" dyntype="filter" dynprm=".05" actlimited="true"
             actrange="-.2 .3"/>
    <general name="adding" joint="hip" dyntype="integrator" actlimited="true" actrange="-.1 .05"/>
    <general name="fast" joint="hip" dyntype="filterexact" dynprm=".005"/>
  </actuator>
  <sensor><jointpos name="angle" joint="hip"/></sensor>
</mujoco>
"""


@pytest.mark.parametrize(
    ("integrator", "delay", "substeps"), [("Euler", 0, 4), ("RK4", 1, 1), ("implicitfast", 3, 2)]
)
def test_activations_are_what_the_commands_since_the_start_made_of_them(
    integrator: str, delay: int, substeps: int
):
    """An unknown command is the one before."""
    robot = Robot("one-legged", FILTERS.format(integrator=integrator), substeps * 0.005)
    commands = np.random.default_rng(0).normal(size=(40, robot.model.nu))
    holes = commands.copy()
    holes[5:9], commands[5:9] = np.nan, commands[4]
    data = mujoco.MjData(robot.model)
    rows = [data.act.copy()]
    for k in range(len(commands) - 1):
        data.ctrl[:] = commands[k - delay] if k >= delay else 0
        mujoco.mj_step(robot.model, data, robot.substeps)
        rows.append(data.act.copy())

    np.testing.assert_array_equal(activations(robot, holes, delay), rows)


def test_motors_without_a_state_have_no_activation(quadruped: Robot):
    assert activations(quadruped, np.zeros((4, quadruped.model.nu))).shape == (4, 0)
