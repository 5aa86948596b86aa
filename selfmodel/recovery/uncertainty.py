"""Uncertainty of a self-model: assumed before the first trial, estimated from healthy trials."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.faults.hypothesis import INTACT
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import EXACT_ERROR, Calibration
from selfmodel.simulation.conditions import Uncertainty
from selfmodel.simulation.initial_pose import StartSpread, start_spread
from selfmodel.simulation.model_distribution import LogNormal, exact
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.estimation import encoder_noise
from selfmodel.trials.rotation import directions
from selfmodel.trials.trial import Trial

ASSUMED_NOISE = 0.05
"""Standard deviation of a reading, as a fraction of half its range, before the first trial."""

ASSUMED_WRONG_TOUCHES = 0.025
"""Probability of a wrong touch reading before the first trial."""

ASSUMED_START = StartSpread(0.01, 0.005)
"""Spread of the initial poses before the first trial, rad."""

ASSUMED_FACTORS = 0.1
"""Standard deviation of the logarithm of the factor of a mass or a motor before the first trial;
that of friction and of damping, which models often contain guesses of, is twice as large."""

CALIBRATED = 0.65
"""Factor of the posterior deviations of a calibration. Its intervals of 68 % contain the truth in
86 to 89 % of the parameters (docs/results/calibration.md), as those of deviations 0.65 times as
large would in 68 %."""

BODIES = 0.1
"""Standard deviation of the logarithm of the factor of a single body's mass, and of its inertia: a
calibration fits only those that the bodies share, and a robot of unequal legs walks in curves."""

CONTACTS = 0.5
"""Standard deviation of the logarithms of the stiffness and of the damping of contacts, where a
calibration changed them, this one or an earlier one: its candidates are a factor of 2 apart."""

ASSUMED_DELAYS = (0, 1, 2)
"""Control delays in addition to the model's before the first trial, control steps."""

MIN_SHARE = 0.5
"""Smallest deviation of the initial pose, as a fraction of the noise with which it was measured: a
pose within the noise is not distinguished from the reference pose."""


def assumed_uncertainty(robot: Robot) -> Uncertainty:
    """Returns the uncertainty of a robot before its first trial."""
    touch = _touch(robot.anatomy)
    factors = np.full(4 + robot.model.nu, ASSUMED_FACTORS)
    factors[2:4] *= 2  # friction and damping
    return Uncertainty(
        models=LogNormal(factors, np.full(robot.model.nbody, BODIES)),
        reading_noise=np.where(touch, 0.0, ASSUMED_NOISE),
        wrong_touches=np.where(touch, ASSUMED_WRONG_TOUCHES, 0.0),
        start=ASSUMED_START,
        delays=ASSUMED_DELAYS,
    )


def noise_of_gap(robot: Robot, level: float) -> Uncertainty:
    """Returns the noise of a reality gap alone: the parameters are those of the robot's model.

    Args:
        robot: The robot.
        level: Level of the reality gap.
    """
    touch = _touch(robot.anatomy)
    return Uncertainty(
        models=exact(robot),
        reading_noise=np.where(touch, 0.0, level),
        wrong_touches=np.where(touch, level / 2, 0.0),
        start=start_spread(level),
    )


def estimated_uncertainty(
    simulator: Simulator, trials: Sequence[Trial], calibration: Calibration | None
) -> Uncertainty:
    """Returns the uncertainty of a robot after its healthy trials.

    The noise is that of the trials in excess of the same estimate in noise-free simulations of
    them: a contact changes a reading within a step, too. A model that predicts the trials
    exactly is exact. Without a calibration, the parameters are as uncertain as before the trials.

    Args:
        simulator: The self-model, calibrated if there is a calibration.
        trials: Trials of the healthy robot, at least one.
        calibration: Fit of the self-model to the trials; None without one.
    """
    robot, assumed = simulator.robot, assumed_uncertainty(simulator.robot)
    touch = _touch(robot.anatomy)
    pairs = [(trial.behaviour, _simulated(simulator, trial)) for trial in trials]
    noise = [_excess(_variance, *_signals(pair, _readings)) for pair in pairs]
    wrong = [_excess(_flips, *_signals(pair, _readings)) for pair in pairs]
    angles = [_start_variance(*_signals(pair, _angles)) for pair in pairs]
    tilts = [_start_variance(*_signals(pair, _tilts)) for pair in pairs]
    angle = _deviation(angles)
    found = Uncertainty(
        models=exact(robot),
        reading_noise=np.where(touch, 0.0, np.sqrt(np.mean(noise, axis=0))),
        wrong_touches=np.where(touch, np.mean(wrong, axis=0), 0.0),
        # A base that was not observed is assumed to tilt by half of the joints' deviation.
        start=StartSpread(angle, angle / 2 if np.isnan(tilts).all() else _deviation(tilts)),
    )
    if calibration is None:
        known = replace(found, models=assumed.models, delays=assumed.delays)
        return found if found.is_none else known
    if calibration.error_before < EXACT_ERROR:
        return found
    deviations = CALIBRATED * calibration.deviations
    bodies = np.full(robot.model.nbody, BODIES)
    contacts = CONTACTS if robot.has_fitted_contacts else 0.0
    return replace(found, models=LogNormal(deviations, bodies, contacts))


def _touch(anatomy: Anatomy) -> BoolArray:
    return np.array([sensor.kind == "touch" for sensor in anatomy.sensors], dtype=bool)


def _simulated(simulator: Simulator, trial: Trial) -> Behaviour:
    outcome = simulator.run(
        [(INTACT, trial.plan.controller)],
        trial.behaviour.steps,
        ("sensors", "joint_positions", "base_orientation"),
    )
    signals = {signal: values[0] for signal, values in outcome.behaviour.signals.items()}
    return Behaviour(outcome.behaviour.names, outcome.behaviour.time, signals)


def _signals(
    pair: tuple[Behaviour, Behaviour], columns: Callable[[Behaviour], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    return columns(pair[0]), columns(pair[1])


def _readings(behaviour: Behaviour) -> FloatArray:
    return behaviour["sensors"]


def _angles(behaviour: Behaviour) -> FloatArray:
    return behaviour["joint_positions"]


def _tilts(behaviour: Behaviour) -> FloatArray:
    """Returns roll and pitch as direction cosines, ``(steps, 2)``."""
    return directions(behaviour["base_orientation"])[:, 2:4]


def _excess(
    estimate: Callable[[FloatArray], FloatArray], logged: FloatArray, simulated: FloatArray
) -> FloatArray:
    return np.maximum(estimate(logged) - estimate(simulated), 0.0)


def _variance(series: FloatArray) -> FloatArray:
    return np.square(encoder_noise(series))


def _flips(series: FloatArray) -> FloatArray:
    """Returns the fraction of the steps at which a reading differs from both of its neighbours."""
    before, own, after = series[:-2], series[1:-1], series[2:]
    return np.asarray(((before == after) & (own != before)).mean(axis=0))


def _start_variance(logged: FloatArray, simulated: FloatArray) -> float:
    """Returns the mean variance of the initial pose; NaN if it was not observed."""
    noise = float(np.mean(_excess(_variance, logged, simulated)))
    deviations = np.square(logged[0] - simulated[0])
    known = deviations[np.isfinite(deviations)]
    if not len(known):
        return np.nan
    return max(float(known.mean()) - noise, MIN_SHARE**2 * noise)


def _deviation(variances: Sequence[float]) -> float:
    known = [variance for variance in variances if np.isfinite(variance)]
    return float(np.sqrt(np.mean(known))) if known else 0.0
